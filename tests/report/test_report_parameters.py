"""The section on parameters: differences with bars, and errors of joints no DH table can say."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_results import (
    TRAVEL_RAD,
    covariance,
    dh_model,
    everything,
    identified,
    robot,
    table,
    vec_model,
)

from kinacc.kinematics import vec
from kinacc.kinematics.dh import PARAMETERS, DHModel, forward
from kinacc.kinematics.vec import ERRORS
from kinacc.report import fit_sections

NAMES = [f"j{joint}.{error}.{n}" for joint in range(1, 5) for error in ERRORS for n in range(3)]


def section(slides=False, **tables):
    return fit_sections.parameters(everything() | tables, robot(slides))


def test_differences_have_their_unit_and_standard_deviation():
    change = {"d_mm": [0, 0, 0, 1.5], "alpha_rad": [0, -0.0004, 0, 0]}
    model = dh_model(change) | {"std_alpha_rad": np.full(4, 0.0001)}
    rows = {row[0]: row[1:] for row in table(section(dh_model=model), "DH parameters").rows}
    assert rows["d of joint 4"][:4] == ("100.0000 mm", "101.5000 mm", "+1.5000 mm", "0.1000 mm")
    assert rows["alpha of joint 2"][2:] == ("-0.4000 mrad", "0.1000 mrad", "identified")


def test_an_angle_beta_that_no_joint_has_is_not_listed_and_a_fixed_length_is():
    told = identified(
        j2__d_mm=("fixed", np.nan, "not fitted"), j3__beta_rad=("identified", 1, None)
    )
    named = {row[0] for row in table(section(dh_identified=told), "DH parameters").rows}
    assert "d of joint 2" in named
    assert {each for each in named if each.startswith("beta")} == {"beta of joint 3"}


def errors(slides=False, **tables):
    """Errors and standard deviations of joints by name, j1.eps_z, over the joint's range."""
    found, arm = everything() | tables, robot(slides)
    model = vec.VECModel.from_columns(found["vec_model"], arm.dh.prismatic)
    _, values, std = fit_sections.vec_errors(found, model, arm)
    names = [f"j{joint}.{error}" for joint in range(1, 5) for error in ERRORS]
    flat = [each.reshape(len(names), -1) for each in (values, std)]
    return [dict(zip(names, each, strict=True)) for each in flat]


def test_what_a_dh_table_can_say_is_left_out_of_the_errors_of_joints():
    at = np.linspace(-1.0, 1.0, 200)
    wave = np.polynomial.chebyshev.chebfit(at, np.cos(TRAVEL_RAD * at + 0.3), 10)
    same = {f"j2__{each}__{n}": c for each in ("eps_x", "eps_z") for n, c in enumerate(wave)}
    found, _ = errors(vec_model=vec_model(10, j1__delta_z__0=3.0, **same))
    assert found["j1.delta_z"] == pytest.approx(0.0, abs=1e-5)
    assert found["j2.eps_x"] == pytest.approx(0.0, abs=1e-4)  # the neighbour's frame
    assert np.ptp(found["j2.eps_z"]) > 500.0  # about its own axis: an eccentric encoder


def between(slides: bool, joint: int, twist: np.ndarray) -> dict[str, float]:
    """Coefficients of the error of a joint, from 0, that is a small ``twist`` (6,) behind it."""
    at = np.linspace(-1.0, 1.0, 60)
    arm = robot(slides)
    held = DHModel(*(getattr(arm.dh, name)[joint : joint + 1] for name in PARAMETERS))
    if slides:
        held = replace(held, prismatic=np.ones(1, bool))
    passed = forward(held, arm.q_max_rad[joint] * at[:, None])
    turn = passed.rotation @ twist[3:]
    shift = passed.rotation @ twist[:3] + np.cross(passed.position_mm, turn)
    curves = np.polynomial.chebyshev.chebfit(at, np.concatenate([shift, turn], axis=1), 12)
    return {
        f"j{joint + 1}__{error}__{n}": curves[n, i]
        for i, error in enumerate(ERRORS)
        for n in range(13)
    }


@pytest.mark.parametrize(("slides", "joint"), [(False, 1), (True, 3)])
def test_what_is_left_out_changes_no_pose_where_the_neighbour_takes_it_over(slides, joint):
    twist = np.array([0.02, -0.03, 0.01, 1e-5, 2e-5, -3e-5])  # mm and rad
    moved = between(slides, joint, twist)
    if not slides:  # the joint behind takes it back; behind the last one the tool does
        moved |= {f"j{joint + 2}__{e}__0": -c for e, c in zip(ERRORS, twist, strict=True)}
    model = vec_model(12, **moved)
    arm = robot(slides)
    if not slides:
        q = arm.q_max_rad * np.random.default_rng(1).uniform(-1, 1, (20, 4))
        same = vec.forward(vec.VECModel.from_columns(model, arm.dh.prismatic), q)
        assert same.position_mm == pytest.approx(forward(arm.dh, q).position_mm, abs=1e-4)
    found, _ = errors(slides=slides, vec_model=model)
    for error in ERRORS:
        assert found[f"j{joint + 1}.{error}"] == pytest.approx(0, abs=1e-5)


def test_the_standard_deviation_is_of_what_is_shown():
    variance = np.zeros(len(NAMES))
    variance[NAMES.index("j1.eps_z.0")] = 1.0  # a constant: no pose tells whose it is
    variance[NAMES.index("j1.eps_z.2")] = 1e-6
    known = covariance(NAMES, np.diag(variance))
    model = vec_model(j1__eps_z__2=0.002)
    found, std = errors(vec_model=model, vec_covariance=known)
    value, spread = found["j1.eps_z"], std["j1.eps_z"]
    # A standard deviation of half the coefficient: two of them are the curve's own height.
    assert 2.0 * spread == pytest.approx(np.abs(value), abs=1e-5)
    assert value.mean() == pytest.approx(0.0, abs=1e-6)
    assert np.ptp(value) == pytest.approx(4.0)
    shown = section(vec_model=model, vec_covariance=known)
    at_an_end = table(shown, "The largest of every error").rows[0][-1]
    assert [float(each) for each in at_an_end.split(" ± ")] == pytest.approx(
        [value[0], spread[0]], abs=1e-3
    )
