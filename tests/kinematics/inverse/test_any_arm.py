"""Inverse of arms of every kind: verified, complete, named, within limits."""

from __future__ import annotations

from dataclasses import replace

import arms
import numpy as np
import pytest
from calibration import simulated
from oracles import inverse as brute
from oracles import kinematics as oracle
from pose_checks import assert_same, of_matrices

from kinacc.errors import InputError
from kinacc.geometry import Pose
from kinacc.kinematics import dh, inverse, robot, vec
from kinacc.kinematics.inverse import Status, closed_form, limits, newton, postures
from kinacc.kinematics.model import JointState
from kinacc.synthetic.draw import TABLE_II

MH180, UR10, IIWA = (robot.load(name) for name in ("mh180", "ur10", "iiwa14"))
FANUC = robot.load("fanuc_r2000ic_165f").dh
COUNT = 10
SEARCHED = [
    arms.OFFSET_WRIST,
    arms.GENERAL,
    arms.STANFORD,
    arms.SCARA,
    arms.FIVE,
    arms.ON_A_TRACK,
    arms.OFFSET_ELBOW,
]


def sideways(model: dh.DHModel) -> dh.DHModel:
    """The arm with a shoulder offset and a tilted, shifted flange."""
    return replace(
        model,
        d_mm=model.d_mm + np.array([0, 80, 25, 0, 0, 0]),
        a_mm=model.a_mm + np.array([0, 0, 0, 0, 0, 40]),
        beta_rad=np.array([0, 0, 0, 0, 0, 0.3]),
    )


def wavy(arm: robot.Robot, q: np.ndarray) -> vec.VECModel:
    """A VEC model of the calibrated arm, over the range of joints (n, k)."""
    plain = vec.without_errors(arms.calibrated(arm), q.min(axis=0), q.max(axis=0), 3)
    return simulated.wavy(plain, np.random.default_rng(2))


@pytest.mark.parametrize("model", [MH180.dh, FANUC, UR10.dh, *map(sideways, (MH180.dh, FANUC))])
def test_closed_forms_return_to_the_pose_and_name_branches_by_posture(model):
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (1000, 6))
    pose = dh.forward(model, q)
    found, reached = closed_form.recognise(model).solve(pose)
    rows, columns = np.nonzero(reached)
    back = dh.forward(model, found[rows, columns])
    assert_same(back, arms.pick(pose, rows), 1e-8, 1e-11)
    nearest = np.where(reached, arms.apart(model, found, q[:, None]), np.inf).min(axis=1)
    assert np.quantile(nearest, 0.99) < 1e-9
    assert nearest.max() < 1e-6  # beside a singular posture angles lose digits, the pose does not
    if closed_form.recognise(model).parallel:  # whose elbow is bent towards axis 4
        return
    named = postures.classes_of(model, found[rows, columns])
    assert (named == columns).mean() > 0.999


@pytest.mark.parametrize(
    ("arm", "kind"),
    [
        *((arm, "nominal") for arm in (MH180, UR10, IIWA, *SEARCHED)),
        *((arm, "vec") for arm in (MH180, UR10, IIWA, *SEARCHED[:5])),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_what_is_found_is_verified_and_own_postures_are_among_it(arm, kind):
    q = arms.joints_within(arm, 2 if arm.dh.joints == 7 else COUNT)
    model = arm.dh if kind == "nominal" else wavy(arm, q)
    pose = model.pose(JointState(q))
    solved = inverse.solve(arm, model, pose)
    assert solved.branches == inverse.branches_of(arm)
    assert len(set(solved.branches)) == len(solved.branches)
    arms.assert_verified(model, pose, solved)
    assert arms.share_missed(arm, q, solved) == 0.0
    inside = solved.status == Status.FOUND
    assert limits.within_limits(arm, solved.q_rad[inside]).all()
    outside = solved.status == Status.OUTSIDE_LIMITS
    assert not limits.within_limits(arm, solved.q_rad[outside]).any()
    if arm is IIWA:
        first = [float(name.split("=")[1].split("deg")[0]) for name in solved.branches]
        assert sorted(set(first)) == list(range(-150, 151, 30))
        there = np.isfinite(solved.q_rad[..., 0])
        turned = np.broadcast_to(np.deg2rad(first), there.shape)
        np.testing.assert_allclose(solved.q_rad[there, 0], turned[there])


@pytest.mark.parametrize("where", ["wrist", "elbow"])
def test_few_branches_are_dropped_near_singular_postures(where):
    q = np.random.default_rng(7).uniform(MH180.q_min_rad, MH180.q_max_rad, (1000, 6))
    aside = np.random.default_rng(8).uniform(-0.02, 0.02, 1000)
    q[:, 4 if where == "wrist" else 2] = aside + (0 if where == "wrist" else np.arctan2(1225, 300))
    pose = dh.forward(TABLE_II, q)
    solved = inverse.solve(MH180, TABLE_II, pose)
    arms.assert_verified(TABLE_II, pose, solved)
    assert arms.share_missed(MH180, q, solved) < 0.01
    _, reached = closed_form.recognise(MH180.dh).solve(pose)
    assert np.mean(reached & (solved.status == Status.NOT_REACHED)) < 0.02


@pytest.mark.parametrize(
    ("arm", "off_mm"),
    [(MH180, 0.0), (MH180, 0.3), (UR10, 0.0), (arms.OFFSET_WRIST, 0.0), (arms.GENERAL, 0.0)],
    ids=["closed form", "off a closed form", "ur10", "offset wrist", "general"],
)
def test_brute_force_finds_all_that_is_listed_and_nothing_more(arm, off_mm):
    model, rng = arms.calibrated(arm, off_mm), np.random.default_rng(11)
    table = model.start.reshape(-1, 5)
    for q in arms.joints_within(arm, 4, seed=3):
        target = oracle.dh_forward(table, q)
        solved = inverse.solve(arm, model, of_matrices(target[None])).q_rad[0]
        listed = solved[np.isfinite(solved[:, 0])]
        found = brute.all_solutions(table, target, rng.uniform(-np.pi, np.pi, (400, 6)))
        distance = arms.apart(arm, np.array(found)[:, None], listed[None])
        assert distance.min(axis=1).max() < 1e-4
        assert np.unique(distance.argmin(axis=1)).size == len(listed)


@pytest.mark.parametrize("arm", [UR10, arms.OFFSET_WRIST, arms.STANFORD], ids=lambda a: a.name)
def test_branches_do_not_depend_on_the_batch_and_follow_a_path(arm):
    start, end = arms.joints_within(arm, 2, seed=4)
    q = start + np.linspace(0.0, 0.02, 15)[:, None] * (end - start)
    pose = dh.forward(arm.dh, q)
    whole = inverse.solve(arm, arm.dh, pose)
    alone = inverse.solve(arm, arm.dh, arms.pick(pose, [7]))
    assert np.array_equal(alone.status[0], whole.status[7])
    found = np.isfinite(alone.q_rad[0])
    assert np.abs(alone.q_rad[0] - whole.q_rad[7])[found].max() < 1e-7
    near = arms.apart(arm, whole.q_rad, q[:, None])
    column = np.nanargmin(np.where(np.isnan(near), np.inf, near), axis=1)
    assert (column == column[0]).all()


def test_some_branches_are_that_part_of_all():
    pose = dh.forward(UR10.dh, arms.joints_within(UR10, 40))
    everything = inverse.solve(UR10, UR10.dh, pose)
    chosen = ("back-down-flip", "front-up-noflip")
    part = inverse.solve(UR10, UR10.dh, pose, chosen)
    columns = [everything.branches.index(name) for name in chosen]
    assert np.array_equal(part.q_rad, everything.q_rad[:, columns], equal_nan=True)
    with pytest.raises(InputError):
        inverse.solve(UR10, UR10.dh, pose, ("front",))


def test_solutions_outside_the_fitted_range_say_so():
    q = arms.joints_within(MH180, 300)
    model = wavy(MH180, q)
    fitted = np.deg2rad([-60.0] * 3 + [-180.0] * 3), np.deg2rad([60.0] * 3 + [180.0] * 3)
    pose = vec.pose(model, q)
    solved = inverse.solve(MH180, model, pose, fitted_range_rad=fitted)
    for status, inside in ((Status.FOUND, True), (Status.OUTSIDE_RANGE, False)):
        joints = solved.q_rad[solved.status == status]
        assert len(joints)
        assert limits.within_limits(MH180, joints).all()
        assert (limits.within(joints, *fitted) == inside).all()


def test_out_of_reach_is_said():
    pose = Pose(np.eye(3)[None], np.array([[9000.0, 0.0, 0.0]]))
    for arm in (MH180, UR10, IIWA, arms.OFFSET_WRIST, arms.STANFORD):
        solved = inverse.solve(arm, arm.dh, pose)
        assert (solved.status == Status.NOT_REACHED).all()
        assert np.isnan(solved.q_rad).all()
    refined = newton.refine(MH180.dh, pose, np.zeros((1, 6)))
    assert not refined.converged[0]
    assert refined.error_mm[0] > 1000


def test_machining_branches_face_the_work_with_the_elbow_up():
    up = ("front-up-noflip", "front-up-flip")
    assert inverse.machining_branches(UR10) == up
    assert inverse.machining_branches(arms.OFFSET_WRIST)[:2] == up
    assert inverse.machining_branches(IIWA) == inverse.branches_of(IIWA)
    turned = Pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    assert inverse.machining_branches(replace(MH180, base=turned))[0] == "front-down-noflip"
