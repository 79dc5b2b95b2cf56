"""Two calibrations of one arm on a page: what moved, where, and by how much more than chance."""

from __future__ import annotations

import numpy as np

from kinacc.config.error_models import model_name
from kinacc.deployment import compare
from kinacc.deployment.compare import Difference, Shift
from kinacc.deployment.record import Calibration
from kinacc.figures import comparison
from kinacc.report.comparison_lines import NEXT, lines
from kinacc.report.page import FirstScreen, Page, Part, Table

_FAR = 3.0  # standard deviations
_WORST = 10
_QUANTILES = {"50%": 0.5, "90%": 0.9, "99%": 0.99, "all": 1.0}
_HOW = ("as they stand", "after the best base and tool")
_REMARKS = {
    "": "",
    "first": "undetermined in the first",
    "second": "undetermined in the second",
    "both": "undetermined in both",
}


def comparison_page(found: Difference, first: Calibration, q_rad: np.ndarray) -> Page:
    """The page of a comparison at reported joints ``q_rad`` (n, k), rad and mm, all given to it.

    ``first``: the first of the two calibrations.
    """
    q_rad = q_rad[found.covered]
    slides = np.asarray(first.robot.dh.prismatic)
    robots = ", ".join(dict.fromkeys(found.robots))
    valid = "For these poses of the flange in the robot's base, as modelled; no readings."
    screen = FirstScreen(
        "{1} against {0}".format(*found.names),
        f"{robots}, {model_name(found.model)} model; {len(q_rad)} poses of the flange",
        (found.verdict.upper(), found.verdict not in (compare.SAME_READINGS, compare.UNPROVEN)),
        list(map(_sentence, lines(found))),
        [] if found.verdict == compare.NOT_COMPARABLE else [_table(found)],
        {"VALID": [valid], "NEXT": [_sentence(NEXT[found.verdict])]},
    )
    parts = [_moved(found), _where(found, np.where(slides, q_rad, np.rad2deg(q_rad)), slides)]
    if found.parameters is not None and len(found.parameters):
        rows = [
            each | {"remarks": _REMARKS[each["undetermined"]]}
            for each in found.parameters.to_dict("records")
        ]
        parts.append(Part("changes", {"rows": rows, "names": found.names, "far": _FAR}))
    made = {"first": found.names[0], "second": found.names[1], "model": found.model}
    return Page(screen, parts, {**made, "poses": str(len(q_rad))})


def _shifts(found: Difference) -> dict[str, Shift]:
    return {"plain": found.as_they_stand, "apart": found.apart_from_frames}


def _moved(found: Difference) -> Part:
    """How far poses moved: quantiles of the shifts."""
    rows = []
    for label, share in _QUANTILES.items():
        row: dict = {"share": label}
        for key, shift in _shifts(found).items():
            row[f"{key}_mm"] = np.quantile(shift.position_mm, share)
            row[f"{key}_mrad"] = 1e3 * np.quantile(shift.orientation_rad, share)
        rows.append(row)
    values = {"poses": int(found.covered.sum()), "quantiles": rows}
    return Part("moved", values, figures={"comparison": comparison.draw(found)})


def _where(found: Difference, joints: np.ndarray, slides: np.ndarray) -> Part:
    """The poses that moved the most, with their joints (n, k) in deg or mm."""
    largest = np.argsort(-found.apart_from_frames.position_mm, kind="stable")[:_WORST]
    number = 1 + np.flatnonzero(found.covered)
    rows = [
        {
            "number": number[row],
            **{f"{key}_mm": shift.position_mm[row] for key, shift in _shifts(found).items()},
            **{f"q{n}": joint for n, joint in enumerate(joints[row], start=1)},
        }
        for row in largest
    ]
    return Part("where", {"poses": len(joints), "largest": rows, "slides": slides.tolist()})


def _table(found: Difference) -> Table:
    rows = [
        {
            "how": label,
            "rms_mm": shift.rms_mm,
            "chance_mm": shift.chance_mm,
            "largest_mm": shift.position_mm.max(),
            "rms_mrad": 1e3 * shift.rms_rad,
            "chance_mrad": 1e3 * shift.chance_rad,
        }
        for label, shift in zip(_HOW, _shifts(found).values(), strict=True)
    ]
    heads = ("rms mm", "by chance mm", "largest mm", "rms mrad", "by chance mrad")
    columns = [["", "how"]]
    columns += [[head, key, ".3f"] for head, key in zip(heads, list(rows[0])[1:], strict=True)]
    return Table(
        "Distance of the poses of {1} from those of {0}".format(*found.names), rows, columns
    )


def _sentence(line: str) -> str:
    """A line with a capital at its begin and a stop at its end."""
    return f"{line[:1].upper()}{line[1:]}."
