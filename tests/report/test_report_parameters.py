"""The section on parameters: differences with bars, and errors of joints no DH table can say."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from kinacc.kinematics import vec
from kinacc.kinematics.dh import PARAMETERS, DHModel, forward
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.vec import ERRORS
from kinacc.report import fit_sections

TRAVEL_RAD = np.pi / 2  # either way; of the sliding joint 100 mm


def robot(slides: bool = False) -> Robot:
    """Four joints that turn, or three and one that slides."""
    turn, none = np.pi / 2, np.zeros(4)
    lengths = [300.0, 0.0, 0.0, 100.0], [0.0, 500.0, 400.0, 0.0]
    model = DHModel(none, *lengths, [turn, 0.0, turn, 0.0], none, [False] * 3 + [slides])
    limit = np.where(model.prismatic, 100.0, TRAVEL_RAD)
    return Robot("made up", model, -limit, limit, np.eye(4), "nobody's catalogue")


def vec_model(order: int = 2, **coefficients: float) -> dict:
    """``vec_model`` over all travel; ``coefficients`` by name: j1__eps_z__2."""
    names = ["joint", "error", "order"]
    table = pd.MultiIndex.from_product([range(1, 5), ERRORS, range(order + 1)], names=names)
    table = table.to_frame(index=False).assign(direction=0, std=np.nan)
    called = "j" + table["joint"].astype(str) + "__" + table["error"] + "__"
    table["coefficient"] = (called + table["order"].astype(str)).map(coefficients).fillna(0.0)
    for name in PARAMETERS:
        table[name] = getattr(robot().dh, name)[table["joint"] - 1]
    return dict(table.assign(q_min_rad=-TRAVEL_RAD, q_max_rad=TRAVEL_RAD))


def test_differences_have_their_unit_and_standard_deviation():
    model = {"joint": np.arange(1, 5)}
    for name in PARAMETERS:
        model[name] = getattr(robot().dh, name).copy()
    model["d_mm"][3] += 1.5
    model["alpha_rad"][1] -= 0.0004
    names = ["j4.d_mm", "j2.alpha_rad", "j3.beta_rad"]
    identified = {"parameter": names, "status": ["identified"] * 3}
    identified["std"] = [0.1, 0.0001, 0.0001]
    found = fit_sections.dh_parameters(model, identified, robot()).set_index("called")
    shown = found[["nominal", "calibrated", "difference", "std"]]
    assert shown.loc["d of joint 4"].tolist() == pytest.approx([100.0, 101.5, 1.5, 0.1])
    turned = [0.0, np.rad2deg(-0.0004), -0.4, 0.1]
    assert shown.loc["alpha of joint 2"].tolist() == pytest.approx(turned)
    units = found.loc["alpha of joint 2", ["of", "unit", "status"]]
    assert units.tolist() == ["deg", "mrad", "identified"]
    assert found.loc["d of joint 2", "status"] == "fixed"
    assert [name for name in found.index if "beta" in name] == ["beta of joint 3"]


def errors(model: dict, slides=False, **tables):
    """Errors and standard deviations of joints by name, j1.eps_z, over the joint's range."""
    arm = robot(slides)
    of_columns = vec.VECModel.from_columns(model, arm.dh)
    _, values, std = fit_sections.vec_errors({"vec_model": model} | tables, of_columns, arm)
    names = [f"j{joint}.{error}" for joint in range(1, 5) for error in ERRORS]
    flat = [each.reshape(len(names), -1) for each in (values, std)]
    return [dict(zip(names, each, strict=True)) for each in flat]


def between(slides: bool, joint: int, twist: np.ndarray) -> dict[str, float]:
    """Coefficients of the error of a joint, from 0, that is a small ``twist`` (6,) behind it."""
    places = np.linspace(-1.0, 1.0, 60)
    arm = robot(slides)
    link = DHModel(*(getattr(arm.dh, name)[joint : joint + 1] for name in PARAMETERS))
    link = replace(link, prismatic=np.full(1, slides))
    passed = forward(link, arm.q_max_rad[joint] * places[:, None])
    turn = passed.rotation @ twist[3:]
    shift = passed.rotation @ twist[:3] + np.cross(passed.position_mm, turn)
    curves = np.polynomial.chebyshev.chebfit(places, np.concatenate([shift, turn], axis=1), 12)
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
        same = vec.pose(vec.VECModel.from_columns(model, arm.dh), q)
        assert same.position_mm == pytest.approx(forward(arm.dh, q).position_mm, abs=1e-4)
    found, _ = errors(model, slides)
    for error in ERRORS:
        assert found[f"j{joint + 1}.{error}"] == pytest.approx(0, abs=1e-5)


def test_the_standard_deviation_is_of_what_is_shown():
    names = [f"j{joint}.{e}.{n}" for joint in range(1, 5) for e in ERRORS for n in range(3)]
    # Of the constant no pose tells whose it is.
    variance = pd.Series(0.0, names) + pd.Series({"j1.eps_z.0": 1.0, "j1.eps_z.2": 1e-6})
    known = pd.DataFrame(np.diag(variance.fillna(0.0)[names]), names, names).stack().reset_index()
    known = dict(known.set_axis(["parameter", "other", "covariance"], axis=1))
    found, std = errors(vec_model(j1__eps_z__2=0.002), vec_covariance=known)
    value, spread = found["j1.eps_z"], std["j1.eps_z"]
    # A standard deviation of half the coefficient: two of them are the curve's own height.
    assert 2.0 * spread == pytest.approx(np.abs(value), abs=1e-5)
    assert value.mean() == pytest.approx(0.0, abs=1e-6)
    assert np.ptp(value) == pytest.approx(4.0)
