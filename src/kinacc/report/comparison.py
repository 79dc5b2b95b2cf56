"""A comparison of two calibrations of one arm as lines and as a page."""

from __future__ import annotations

import numpy as np

from kinacc.config.error_models import model_name
from kinacc.deployment import compare
from kinacc.deployment.compare import Difference
from kinacc.deployment.record import Calibration
from kinacc.figures.calibration import draw_comparison
from kinacc.report import rendering
from kinacc.report.page import FirstScreen, Page, Part, Table

_FAR = 3.0  # standard deviations
_WORST = 10
_QUANTILES = {"50%": 0.5, "90%": 0.9, "99%": 0.99, "all": 1.0}
_VALID = "Modelled poses of the flange in the robot's base."
_NEXT = "Where a change matters: measure the poses of the first again, calibrate, compare."


def lines(difference: Difference) -> list[str]:
    """The verdict, its evidence, and what the figures include.

    Parameters
    ----------
    difference
        Comparison of two calibrations.

    Returns
    -------
    list of str
        A sentence or two each, the verdict first.
    """
    return rendering.lines("comparison.txt", found=difference, compare=compare)


def comparison_page(difference: Difference, first: Calibration, q_rad: np.ndarray) -> Page:
    """The page of a comparison.

    Parameters
    ----------
    difference
        Comparison of two calibrations.
    first
        The first of them.
    q_rad
        Reported joints (n, k) at which they were to be compared, rad (mm where a joint slides).

    Returns
    -------
    Page
        Verdict, shifts of the poses and changes of the parameters.
    """
    poses, names, verdict = difference.poses, difference.names, difference.verdict
    slides = np.asarray(first.robot.dh.prismatic)
    joints = np.where(slides, q_rad, np.rad2deg(q_rad))[poses["pose"] - 1]
    worst = poses.assign(**{f"q{n}": joint for n, joint in enumerate(joints.T, start=1)})
    worst = worst.sort_values("arm_moved_mm", ascending=False, kind="stable").head(_WORST)
    columns = ["moved_mm", "turned_mrad", "arm_moved_mm", "arm_turned_mrad"]
    quantiles = poses[columns].quantile([*_QUANTILES.values()]).assign(share=[*_QUANTILES])
    picture = {"comparison": draw_comparison(difference)}
    count = len(poses)
    parts = [
        Part("moved", {"poses": count, "quantiles": quantiles}, picture),
        Part("where", {"poses": count, "largest": worst, "slides": slides.tolist()}),
    ]
    if difference.parameters is not None and len(difference.parameters):
        values = {"rows": difference.parameters, "names": names, "far": _FAR}
        parts.append(Part("changes", values))
    heads = ("rms mm", "by chance mm", "largest mm", "rms mrad", "by chance mrad")
    shifts = difference.shifts
    shown = [[head, name, ".3f"] for head, name in zip(heads, shifts.columns[1:], strict=True)]
    caption = "Change of flange poses from {} to {}".format(*names)
    table = Table(caption, shifts.to_dict("records"), [["", "frames"], *shown])
    robots = ", ".join(dict.fromkeys(difference.robots))
    screen = FirstScreen(
        "{1} against {0}".format(*names),
        f"{robots}, {model_name(difference.model)} model; {count} poses of the flange",
        (verdict.upper(), verdict not in (compare.SAME_READINGS, compare.UNPROVEN)),
        lines(difference),
        [] if verdict == compare.NOT_COMPARABLE else [table],
        {"VALID": [_VALID], "NEXT": [_NEXT]},
    )
    made = {"first": names[0], "second": names[1], "model": difference.model}
    return Page(screen, parts, {**made, "poses": str(count)})
