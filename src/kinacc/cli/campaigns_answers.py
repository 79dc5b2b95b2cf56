"""Answers of the commands of ``kinacc campaign``: facts for machines, words for people."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from kinacc.assess.conformity import decide
from kinacc.assess.statement import Statement
from kinacc.campaign import consistency, instrument, words
from kinacc.campaign.plan import Plan
from kinacc.campaign.state import State
from kinacc.cli.sheet import Field, Sheet
from kinacc.cli.tables import joint_fields
from kinacc.geometry import invert
from kinacc.tables.columns import Columns, joint_count
from kinacc.tables.contract import ARTEFACTS

if TYPE_CHECKING:
    from kinacc.campaign.prediction_check import Unsure


def begun_facts(folder: str, begun: Plan, unsure: Unsure | None) -> dict[str, object]:
    """What was begun, for a machine."""
    return {
        "folder": folder,
        **begun.about,
        "points": len(begun.points),
        "first_visit": len(begun.route),
        "assessor": begun.assessor.name,
        "budget": begun.assessor.measurements,
        "implausible_mm": begun.limits.implausible_mm,
        "joint_tolerance_deg": math.degrees(begun.limits.joint_rad),
        "prediction": None if unsure is None else asdict(unsure),
        "begun_against": list(begun.overruled),
    }


def begun_in_words(folder: str, begun: Plan, merged: int, targets: Sequence[str]) -> str:
    """What was begun, of candidates of which ``merged`` repeated the joints of others.

    ``targets``: those of the calibration, one of which the campaign may be about.
    """
    too_few = words.reason(begun.assessor.shortfall(*begun.points.joints.shape))
    named = ", ".join(f"{each.name} ({instrument.noise(each)})" for each in begun.instruments)
    lines = [
        f"campaign begun in {folder}",
        f"{len(begun.points)} candidates ({begun.about['candidates']})"
        + (f"; {merged} rows repeat the joints of others" if merged else ""),
        f"the {begun.about['point']} of {begun.about['robot']}, {begun.about['model']} model of "
        f"{begun.about['calibration']}",
        *words.one_of(begun.about["point"], targets),
        f"instruments: {named}",
        *words.trackers(begun),
        f"{begun.assessor.name}: {begun.assessor.measurements} readings, the first at "
        f"{len(begun.route)} points whatever they say",
        *words.arrangements(begun),
        *([too_few] if too_few else []),
        *words.begun_against(begun),
        f"a reading is refused {_refusals(begun)}",
        f"next: kinacc campaign next {shlex.quote(folder)}",
    ]
    return "\n".join(lines)


def _refusals(begun: Plan) -> str:
    """When a reading is refused."""
    return (
        f"more than {math.degrees(begun.limits.joint_rad):g} deg from the joints asked for, or "
        f"more than {begun.limits.implausible_mm:g} mm from the model"
    )


def sheet_of(name: str, columns: Columns) -> Sheet:
    """A table of a report for other programs, with units and meanings of its contract."""
    contract = ARTEFACTS[name]
    known = {each.name: each for each in contract.for_joints(joint_count(contract, columns))}
    fields = [
        Field(each, np.asarray(values), known[each].unit, known[each].meaning)
        for each, values in columns.items()
    ]
    return Sheet("", {}, fields)


def next_in_words(found: State) -> str:
    """The point to measure next: joints, and where the model expects the reading."""
    begun, point = found.plan, found.asked
    joints = begun.points.joints[point]
    lines = [f"point {begun.points.label[point]}, reading {len(found.told) + 1} of "
             f"{begun.assessor.measurements}"]  # fmt: skip
    for joint, value in enumerate(joints):
        if begun.slides[joint]:
            shown = f"{value:12.4f} mm"
        else:
            shown = f"{math.degrees(value):12.4f} deg  {value:12.7f} rad"
        arrive = ""
        if begun.points.directions is not None and begun.points.directions[point, joint]:
            arrive = "  arriving " + ("up" if begun.points.directions[point, joint] > 0 else "down")
        lines.append(f"  q{joint + 1} {shown}{arrive}")
    x, y, z = _expected(begun, [point])[0]
    lines.append(f"expected at {x:.3f}, {y:.3f}, {z:.3f} mm in the {_frame(begun)} frame")
    again = sum(each.reading.point == point for each in found.told)
    if again:
        times = "once" if again == 1 else f"{again} times"
        lines.append(f"read {times} before: leave the pose and come back to it")
    return "\n".join(lines)


def visit_sheet(begun: Plan, points: list[int]) -> Sheet:
    """Joints and expected readings of points, in the order to measure them."""
    joints = begun.points.joints[points]
    seen, about = _expected(begun, points), f"modelled, in the {_frame(begun)} frame"
    label = np.array([begun.points.label[each] for each in points], dtype=object)
    fields = [Field("pose", label, "", "name of the point among the candidates")]
    fields += joint_fields(begun.slides, joints)
    fields += [
        Field(f"q{joint + 1}_rad", joints[:, joint], "rad", f"joint {joint + 1}", False)
        for joint, slides in enumerate(begun.slides)
        if not slides
    ]
    if begun.points.directions is not None:
        fields += [
            Field(f"s{joint + 1}", begun.points.directions[points, joint], "1", "travel", False)
            for joint in range(joints.shape[1])
        ]
    fields += [
        Field(f"expected_{axis}_mm", seen[:, i], "mm", about) for i, axis in enumerate("xyz")
    ]
    return Sheet("", dict(begun.about), fields, shown_rows=60)


def _expected(begun: Plan, points: list[int]) -> np.ndarray:
    """Modelled positions (n, 3) of points in the frame the readings come in."""
    modelled = begun.points.modelled_mm[points]
    if _frame(begun) != instrument.INSTRUMENT:
        return modelled
    back = invert(begun.to_base)
    return modelled @ back.rotation.T + back.position_mm


def _frame(begun: Plan) -> str:
    """Frame of the readings, which is one for all instruments."""
    return begun.instruments[0].frame


def as_facts(found: State, tolerance: float | None) -> dict[str, object]:
    """The standing of a campaign for a machine."""
    label = found.plan.points.label
    return {
        **found.plan.about,
        "assessor": found.plan.assessor.name,
        "budget": found.plan.assessor.measurements,
        "begun_against": list(found.plan.overruled),
        "readings": found.taken,
        "readings_used": len(found.told),
        "points": len(label) - len(found.left_out),
        "points_measured": len({each.reading.point for each in found.told}),
        "left_out": {label[point]: reason for point, reason in found.left_out.items()},
        "struck": {str(each.number): reason for each, reason in found.struck},
        "scatter": _scatter_facts(found),
        "too_near": consistency.too_near(found),
        "next": None if found.asked is None else label[found.asked],
        "statements": [_statement_facts(said, found, tolerance) for said in found.statements()],
    }


def _scatter_facts(found: State) -> dict[str, object] | None:
    """Scatter of repeated readings for a machine."""
    seen = consistency.scatter(found)
    if seen is None:
        return None
    return {
        "ratio": seen.ratio,
        "degrees_of_freedom": seen.freedom,
        "probability": seen.probability,
        "in_words": consistency.in_words(seen),
    }


def _statement_facts(said: Statement, found: State, tolerance: float | None) -> dict[str, object]:
    """A statement for a machine; what is not said is no number."""
    facts = {
        "target": said.target,
        "value_mm": said.value_mm,
        "lower_mm": said.lower_mm,
        "upper_mm": said.upper_mm,
        "excepted": said.excepted,
        "error_of": said.error_of,
        "noise": words.reason(said.noise),
        "confidence": said.confidence,
        "share": said.share,
        "assumption": words.reason(said.assumption),
        "withheld": words.reason(said.withheld),
        "in_words": words.statement(said, found),
    }
    if tolerance is not None:
        facts |= {"tolerance_mm": tolerance, "decision": _decision_facts(said, tolerance)}
    return facts


def _decision_facts(said: Statement, tolerance: float) -> dict[str, object]:
    """A decision for a machine."""
    found = decide(said, tolerance)
    return {
        "verdict": found.verdict,
        "reason": words.reason(found.reason),
        "guard_band_mm": found.guard_band_mm,
        "acceptance_limit_mm": found.acceptance_limit_mm,
        "risk": found.risk,
    }
