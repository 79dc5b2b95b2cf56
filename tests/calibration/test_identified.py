"""Which parameters data determine, and the sentences about those they do not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from simulated import POINT, POSE, THREE, disturbed, joints, measure

from kinacc.calibration import blind_words, constraints, fitting, identified, tables, uncertainty
from kinacc.calibration.frames import MOTIONS
from kinacc.config import parameter_rules
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot


class Said(NamedTuple):
    name: str
    status: str
    statement: str


def asked(name, kind=POSE, sessions=1, instead=False, rules=None, moving=None, poses=80):
    """Parameters of a fit to simulated poses by name; joints not in ``moving`` stand still."""
    arm, rng = robot.load(name), np.random.default_rng(0)
    hayati = constraints.parallel_joints(arm.dh)
    free = constraints.free_parameters(arm.dh.joints, hayati, instead)
    q = joints(arm, poses, rng)
    for joint in range(arm.dh.joints) if moving else ():
        if joint + 1 not in moving:
            q[:, joint] = 0.3
    data = measure(disturbed(arm.dh, free, rng), q, kind, rng, sessions=sessions)
    known = constraints.arm_terms(
        arm.dh, free, parameter_rules.rules(rules or {}, parameter_rules.JOINTS)[0]
    )
    fit = fitting.fit(
        data,
        known.nominal,
        free=known.free,
        std=known.std,
        rotation_weight_mm_per_rad=500.0,
        threshold=1e-3,
    )
    told = uncertainty.of_fit(fit, data.target_names)
    return said_of(fit, told, data), fit, told


def said_of(fit, told, data):
    """Rows of ``dh_identified`` by parameter."""
    left_open = identified.left_open(fit, told, data)
    table = tables.identified_columns(identified.parameters(fit, told), left_open, told)
    rows = zip(table["parameter"], table["status"], table["statement"], strict=True)
    return {name: Said(name, status, statement or "") for name, status, statement in rows}


def test_what_every_serial_arm_hides_is_said_in_words():
    found, _, _ = asked("mh180")
    for name, words in {
        "j1.theta_offset_rad": "theta of joint 1 cannot be told from a turn of the base about the "
        "axis of joint 1",
        "j1.d_mm": "d of joint 1 cannot be told from a shift of the base along the axis of joint 1",
        "j6.a_mm": "a of joint 6 cannot be told from a shift of the tool along x of the last frame",
        "j2.d_mm": "d of joint 2 and d of joint 3 appear only as their difference",
        "j3.d_mm": "d of joint 2 and d of joint 3 appear only as their difference",
    }.items():
        assert (found[name].status, found[name].statement) == ("undetermined", words)
    assert found["j4.d_mm"].status == "identified"
    assert found["j4.d_mm"].statement == ""
    assert "axis of joint 1" in found["base.z_mm"].statement


@pytest.mark.parametrize(("kind", "sessions"), [(POINT, 1), (THREE, 2), (POSE, 2)])
def test_three_parallel_axes_show_one_sum(kind, sessions):
    found, _, _ = asked("ur10", kind, sessions)
    for joint in (2, 3, 4):
        words = "d of joint 2, d of joint 3 and d of joint 4 appear only as their sum"
        assert found[f"j{joint}.d_mm"].statement == words
    base = "every base" if sessions == 2 else "the base"
    assert base in found["j1.d_mm"].statement


def test_a_wrist_that_always_points_one_way_leaves_base_and_tool_open():
    """Seen on a measured arm: the tool's length and the base's place go together."""
    arm, rng = robot.load("ur10"), np.random.default_rng(1)
    q = np.zeros((80, 6))
    q[:, 1:3] = rng.uniform([-1.5, 0.5], [-0.5, 1.5], (80, 2))
    q[:, 0] = rng.uniform(-1.0, 1.0, 80)
    q[:, 4] = q[:, 0]  # the last axis keeps its direction
    q[:, 3] = -q[:, 1] - q[:, 2]
    q[:, 5] = rng.uniform(-1.0, 1.0, 80)
    free = constraints.free_parameters(6, (2, 3))
    data = measure(disturbed(arm.dh, free, rng), q, POSE, rng)
    fit = fitting.fit(data, arm.dh, free=free, rotation_weight_mm_per_rad=500.0, threshold=1e-3)
    told = uncertainty.of_fit(fit, data.target_names)
    left_open = identified.left_open(fit, told, data)
    said = blind_words.sentences(left_open)
    weak = (
        "a shift of the base along y of the robot's base cannot be told from a shift of the tool "
        "along z of the last frame (these poses show it too little, others may)"
    )
    assert weak in said
    parameters = identified.parameters(fit, told)
    table = tables.identified_columns(parameters, left_open, told)
    assert weak in blind_words.listed(table)
    assert set(blind_words.listed(table)) <= set(said)
    found = {each.name: each for each in parameters}
    assert found["t0.z_mm"].status == "undetermined"
    place = told.names.index("t0.z_mm")
    assert {each.structural for each in left_open.groups if each.members[place]} == {True, False}


@pytest.mark.parametrize("name", ["mh180", "iiwa14", "meca500"])
def test_every_undetermined_parameter_has_a_statement_and_no_other(name):
    found, fit, _ = asked(name, THREE)
    for each in found.values():
        assert bool(each.statement) == (each.status != "identified"), each
    names = fit.model.names
    for place, parameter in enumerate(names):
        std = fit.std.ravel()[place]
        assert np.isnan(std) == (found[parameter].status in ("undetermined", "fixed"))


def test_a_prior_is_named_and_settles_what_hung_on_it():
    rules = {"joint 2 d": {"prior_std_mm": 0.5}}
    found, _, _ = asked("mh180", rules=rules)
    assert found["j2.d_mm"].statement == "known beforehand to 0.5 mm"
    assert found["j2.d_mm"].status == "prior"
    assert found["j3.d_mm"].status == "identified"


@pytest.mark.parametrize("kind", [POSE, POINT])
def test_directions_in_words_move_no_pose_anywhere(kind):
    """The twin of the sentences: finite steps along each structural direction."""
    arm, rng = robot.load("ur10"), np.random.default_rng(3)
    free = constraints.free_parameters(6, (2, 3))
    data = measure(disturbed(arm.dh, free, rng), joints(arm, 80, rng), kind, rng)
    fit = fitting.fit(data, arm.dh, free=free, rotation_weight_mm_per_rad=500.0, threshold=1e-3)
    told = uncertainty.of_fit(fit, data.target_names)
    groups = identified.left_open(fit, told, data).groups
    directions = np.concatenate([each.directions for each in groups if each.structural])
    assert len(directions) == 8
    arm_part = directions[:, len(told.names) - int(free.sum()) :]
    step = np.where(np.tile([1, 0, 0, 1, 1], 6)[free.ravel()], 1e-3, 1.0) * 1e-3
    q = rng.uniform(-3, 3, (50, 6))

    def moved(frame, pose, direction):
        at = [
            direction[told.names.index(f"{frame}.{m}")] if f"{frame}.{m}" in told.names else 0.0
            for m in MOTIONS
        ]
        at = np.array(at) * 1e-3 * np.repeat([1.0, 1e-3], 3)
        return Pose(exp_so3(at[3:]) @ pose.rotation, pose.position_mm + at[:3])

    before = compose(fit.frames.base, compose(dh.forward(fit.model, q), fit.frames.tool))
    for direction, own in zip(directions, arm_part, strict=True):
        vector = fit.model.start
        vector[free.ravel()] += step * own
        model = fit.model.with_parameters(vector)
        base = moved("base", fit.frames.base, direction)
        tool = moved("t0", fit.frames.tool, direction)
        after = compose(base, compose(dh.forward(model, q), tool))
        assert np.abs(after.position_mm - before.position_mm).max() < 2e-6
