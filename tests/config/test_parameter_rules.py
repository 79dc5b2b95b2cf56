"""Rules about parameters: what they cover, which one holds, every fault at once."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from kinacc.calibration.dh_estimator import arm_terms, free_parameters
from kinacc.config import parameter_rules
from kinacc.config.settings import Calibration, DhFit
from kinacc.kinematics.robot import load


def joint_rules(content):
    return parameter_rules.rules(DhFit(parameters=content).model_dump()["parameters"])


def test_the_rule_that_says_most_holds_in_any_order():
    content = {"d": "fixed", "joint 3": "free", "joint 3 d": {"prior_std_mm": 0.5}}
    content["joint 4"] = "free"
    nominal = load("mh180").dh
    for names in (list(content), list(content)[::-1]):
        rules = joint_rules({name: content[name] for name in names})
        _, free, std = arm_terms(nominal, free_parameters(6), rules)
        np.testing.assert_array_equal(free[:, 1], [False, False, True, True, False, False])
        assert std[2, 1] == 0.5
        assert np.isinf(np.delete(std, 2, axis=0)).all()
        assert free[:, [0, 2, 3]].all()
        assert not free[:, 4].any()


def test_values_are_in_the_units_they_say_and_fix_without_a_prior():
    rules = joint_rules(
        {
            "j2.alpha_rad": {"value_deg": 90.0},
            "joint 4 d": {"value_mm": -1224.0, "prior_std_mm": 2.0},
            "joint 1 theta": {"prior_std_mrad": 3.0},
        }
    )
    nominal = load("mh180").dh
    arm, free, std = arm_terms(nominal, free_parameters(6), rules)
    assert arm.alpha_rad[1] == pytest.approx(np.pi / 2)
    assert not free[1, 3]
    assert (arm.d_mm[3], std[3, 1]) == (-1224.0, 2.0)
    assert free[3, 1]
    assert std[0, 0] == pytest.approx(3e-3)
    assert arm.theta_offset_rad[0] == nominal.theta_offset_rad[0]


@pytest.mark.parametrize(
    ("name", "state", "words"),
    [
        ("joint 3 e", "free", "is no parameter"),
        ("base z", "fixed", "is no parameter"),
        ("d", "loose", "'free' or 'fixed'"),
        ("a", {"prior_std_mrad": 1.0}, "rad is no unit of a_mm"),
        ("alpha", {"prior_std_deg": 1.0, "prior_std_mrad": 1.0}, "two units"),
        ("alpha", {"prior_std_deg": -1.0}, "greater than 0"),
        ("joint 1", {"value_mm": 3.0}, "no one parameter"),
        ("joint 2 d", {"prior_std_mm": True}, "valid number"),
        ("joint 2 d", {"std_mm": 1.0}, "match pattern"),
        ("j2.d_mm", "free", "said twice"),
    ],
)
def test_a_fault_of_a_rule_is_refused(name, state, words):
    content = {"joint 2 d": "free", name: state} if name == "j2.d_mm" else {name: state}
    with pytest.raises(ValidationError, match=words):
        DhFit(parameters=content)


def test_frames_are_named_as_in_the_tables():
    content = {"base": "fixed", "tool.rz_rad": {"prior_std_deg": 1.0}, "mA x": {"value_mm": 3}}
    section = Calibration(frames=content, base_and_tool="estimated").model_dump()
    found = parameter_rules.rules(section["frames"], of_frames=True)
    assert [(rule.frame, rule.parameter) for rule in found] == [
        ("base", None),
        ("tool", "rz_rad"),
        ("mA", "x_mm"),
    ]
    with pytest.raises(ValidationError, match="is no parameter"):
        Calibration(frames={"joint 3 d": "fixed"}, base_and_tool="estimated")
