"""A comparison of two calibrations of one arm as lines and as a page."""

from __future__ import annotations

import numpy as np

from kinacc.config.error_models import model_name
from kinacc.deployment import compare
from kinacc.deployment.compare import Difference
from kinacc.deployment.record import Calibration
from kinacc.figures import comparison
from kinacc.report.page import FirstScreen, Page, Part, Table
from kinacc.report.rendering import size

_FAR = 3.0  # standard deviations
_WORST = 10
_QUANTILES = {"50%": 0.5, "90%": 0.9, "99%": 0.99, "all": 1.0}
_VALID = "Modelled poses of the flange in the robot's base."
_NEXT = "Where a change matters: measure the poses of the first again, calibrate, compare."


def lines(found: Difference) -> list[str]:
    """The verdict, its evidence, and what the figures include."""
    poses, measured = len(found.poses), int(found.poses["measured_by_both"].sum())
    shared, where = found.shared, f"{measured} of {poses} poses lie near measured poses of both"
    test = (
        f"p = {found.probability:.2g} in {found.directions} directions, assuming independent "
        "residuals"
    )
    evidence = {
        compare.OTHER_ROBOT: f"{' and '.join(found.robots)} differ by "
        f"{size(found.robots_apart_mm)} mm rms before calibration",
        compare.SAME_READINGS: f"both calibrations are fitted to the same {shared.count} readings",
        compare.NOT_COMPARABLE: where,
        compare.UNKNOWN: "no covariance of both calibrations",
        compare.IN_DOUBT: f"{test}; {where}",
    }
    told = [f"{found.verdict.upper()}: {evidence.get(found.verdict, test)}."]
    if shared.count and not shared.all_of_both:
        told.append(
            f"Shared readings, counted once: {shared.count} of {shared.first} in "
            f"{found.names[0]} and {shared.second} in {found.names[1]}."
        )
    if poses < found.poses_given:
        told.append(
            f"Compared at {poses} of {found.poses_given} poses, those in the joint range of both "
            f"{model_name(found.model)} models."
        )
    ratios = [
        f"{name} {ratio:.3g}"
        for name, ratio in zip(found.names, found.held_out_over_noise, strict=True)
        if np.isfinite(ratio)
    ]
    if np.isfinite(found.probability):
        over = f" Held-out error over noise: {', '.join(ratios)}." if ratios else ""
        told.append(f"Standard deviations are valid given the model.{over}")
    return told


def comparison_page(found: Difference, first: Calibration, q_rad: np.ndarray) -> Page:
    """The page of a comparison at reported joints ``q_rad`` (n, k), rad and mm, all given to it.

    ``first``: the first of the two calibrations.
    """
    slides = np.asarray(first.robot.dh.prismatic)
    joints = np.where(slides, q_rad, np.rad2deg(q_rad))
    robots = ", ".join(dict.fromkeys(found.robots))
    count = len(found.poses)
    screen = FirstScreen(
        "{1} against {0}".format(*found.names),
        f"{robots}, {model_name(found.model)} model; {count} poses of the flange",
        (found.verdict.upper(), found.verdict not in (compare.SAME_READINGS, compare.UNPROVEN)),
        lines(found),
        [] if found.verdict == compare.NOT_COMPARABLE else [_table(found)],
        {"VALID": [_VALID], "NEXT": [_NEXT]},
    )
    parts = [_moved(found), _where(found, joints, slides)]
    if found.parameters is not None and len(found.parameters):
        rows = found.parameters.to_dict("records")
        parts.append(Part("changes", {"rows": rows, "names": found.names, "far": _FAR}))
    made = {"first": found.names[0], "second": found.names[1], "model": found.model}
    return Page(screen, parts, {**made, "poses": str(count)})


def _moved(found: Difference) -> Part:
    """Quantiles of the change over the poses."""
    names = ["moved_mm", "turned_mrad", "arm_moved_mm", "arm_turned_mrad"]
    quantiles = found.poses[names].quantile([*_QUANTILES.values()])
    rows = quantiles.assign(share=[*_QUANTILES]).to_dict("records")
    values = {"poses": len(found.poses), "quantiles": rows}
    return Part("moved", values, figures={"comparison": comparison.draw(found)})


def _where(found: Difference, joints: np.ndarray, slides: np.ndarray) -> Part:
    """The poses that moved the most, with their joints (n, k) in deg or mm."""
    worst = found.poses.sort_values("arm_moved_mm", ascending=False, kind="stable").head(_WORST)
    rows = [
        row | {f"q{n}": joint for n, joint in enumerate(joints[row["pose"] - 1], start=1)}
        for row in worst.to_dict("records")
    ]
    return Part("where", {"poses": len(found.poses), "largest": rows, "slides": slides.tolist()})


def _table(found: Difference) -> Table:
    heads = ("rms mm", "by chance mm", "largest mm", "rms mrad", "by chance mrad")
    columns = [["", "frames"]]
    columns += [
        [head, name, ".3f"] for head, name in zip(heads, found.shifts.columns[1:], strict=True)
    ]
    caption = "Change of flange poses from {} to {}".format(*found.names)
    return Table(caption, found.shifts.to_dict("records"), columns)
