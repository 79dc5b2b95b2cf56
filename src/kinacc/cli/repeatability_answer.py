"""What repeated readings say, as a table by pose, facts for machines and words for people."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinacc.assess.noise import ENOUGH, FEWEST
from kinacc.calibration.noise import per_axis_mm
from kinacc.campaign.known_noise import FORMAT
from kinacc.checks import repeatability as checks
from kinacc.checks.repeatability import Group, Noise, Parts
from kinacc.cli.repeated_rows import Rows
from kinacc.cli.sheet import Field, Sheet
from kinacc.errors import InputError, Problem, first_few

_A_DAY_H = 1.0  # readings of a pose within less tell nothing of how a day changes
_USUAL_VISITS = 30  # of each pose, by ISO 9283
_LEAST_MM = 1e-6  # no instrument scatters less


@dataclass(frozen=True)
class Found:
    """What the readings of a file say.

    ``by_pose`` probability that poses differ so by chance, ``ratio`` (p,) of each to all.
    """

    rows: Rows
    parts: Parts
    noise: Noise | None
    groups: list[Group]
    by_pose: float
    ratio: np.ndarray

    @property
    def visits(self) -> int:
        return int(self.rows.read.visit.max()) + 1

    @property
    def poses_differ(self) -> bool:
        return self.by_pose < checks.UNEQUAL

    @property
    def span_h(self) -> float:
        """Median of the time from the first to the last reading of a pose; NaN if not told."""
        if self.rows.hours is None:
            return math.nan
        pose, hours = self.rows.read.pose, self.rows.hours
        own = [hours[pose == each] for each in range(len(self.rows.poses))]
        return float(np.median([np.ptp(each) for each in own if len(each) > 1]))


def found_in(rows: Rows) -> Found:
    """Everything about repeated readings. InputError where they do not differ at all."""
    parts = checks.parts(rows.read)
    noise = checks.noise_of(parts, rows.resolution_mm)
    if noise is not None and not (noise.std_mm > _LEAST_MM).all():
        what = "readings of one pose are equal to the last digit, which none of an instrument are"
        raise InputError(Problem(rows.path, what, fix="were predictions or copies read?"))
    by_pose, ratio = checks.differ_by_pose(rows.read, rows.resolution_mm)
    return Found(rows, parts, noise, checks.groups(rows.read), by_pose, ratio)


def as_sheet(found: Found) -> Sheet:
    """A row for each pose and side; the facts are what ``campaign start`` takes."""
    groups, rows = found.groups, found.rows

    def column(make) -> np.ndarray:
        return np.array([make(each) for each in groups])

    names = [rows.poses[each.pose] for each in groups]
    fields = [Field("pose", np.array(names, dtype=object), "", "name of the pose")]
    if rows.sides is not None:
        sides = np.array([rows.sides[each.side] for each in groups], dtype=object)
        fields.append(Field("side", sides, "", "where it was approached from"))
    fields += [
        Field("visits", column(lambda each: each.visits), "1", "times the arm came there"),
        Field("readings", column(lambda each: each.readings), "1", "of these visits"),
        *(
            Field(f"std_{axis}_mm", column(lambda each, i=i: each.std_mm[i]), "mm",
                  "standard deviation between visits")
            for i, axis in enumerate("xyz")
        ),
        Field("distance_mm", column(lambda each: each.mean_distance_mm), "mm",
              "mean distance of the visits from their middle"),
        Field("rp_mm", column(lambda each: each.rp_mm), "mm",
              "ISO 9283: mean distance + 3 standard deviations of the distances"),
    ]  # fmt: skip
    title = (
        f"{rows.path}: {len(rows.read.pose)} readings in {found.visits} visits of "
        f"{len(rows.poses)} poses"
    )
    return Sheet(title, _facts(found), fields)


def _facts(found: Found) -> dict[str, object]:
    mean_mm, rp_mm = checks.pooled_rp(found.rows.read)
    noise = None
    if found.noise is not None:
        low, high = checks.limits(found.noise.std_mm, found.noise.freedom)
        noise = {
            "covariance_mm2": found.noise.covariance_mm2.tolist(),
            "std_mm": found.noise.std_mm.tolist(),
            "std_low_mm": low.tolist(),
            "std_high_mm": high.tolist(),
            "freedom": found.noise.freedom,
            "equal_axes": found.noise.is_even,
        }
    return {
        "format": FORMAT,
        "file": found.rows.path,
        "poses": len(found.rows.poses),
        "visits": found.visits,
        "readings": len(found.rows.read.pose),
        "noise": noise,
        "instrument_std_mm": _std(found.parts.instrument),
        "one_side_std_mm": _std(found.parts.visits),
        "all_sides_std_mm": _std(found.parts.visits + found.parts.sides),
        "mean_distance_mm": mean_mm,
        "rp_mm": rp_mm,
        "between_sides_mm": checks.between_sides_mm(found.rows.read),
        "axes_equal_probability": None if found.noise is None else found.noise.by_axis,
        "poses_equal_probability": found.by_pose,
        "resolution_mm": found.rows.resolution_mm.tolist(),
        "hours_at_a_pose": found.span_h,
        "poses_differ": _of_poses(found) or None,
        "remarks": list(_remarks(found)),
    }


def _std(covariance_mm2: np.ndarray) -> list[float]:
    return np.sqrt(np.diag(covariance_mm2)).tolist()


def in_words(found: Found, written: str | None = None) -> list[str]:
    """What the readings say, and what to do with it; ``written``: the file of the answer."""
    lines = [*_of_parts(found), *_of_iso(found)]
    if found.noise is None:
        return [*lines, _NO_RETURN, *_remarks(found)]
    lines += [_of_noise(found.noise), *_remarks(found)]
    if found.noise.freedom < FEWEST:
        return [*lines, "next: more returns to poses, into the same file"]
    file = written if written and written.endswith(".json") else "noise.json"
    first = "" if file == written else f"with -o {file}, "
    command = f"kinacc campaign start .. --repeatability {shlex.quote(file)}"
    return [*lines, f"next: {first}{command}"]


_NO_RETURN = (
    "the noise of a campaign's readings is not told: no pose was left and come back to, and how "
    "the arm repeats a pose is part of it. Visit 20 poses three times each, leaving them between"
)


def _of_parts(found: Found) -> Iterator[str]:
    """Instrument and arm apart, as far as the readings tell them apart."""
    parts = found.parts
    told = bool(np.isfinite(parts.instrument).all())
    if told:
        yield f"instrument (readings of one visit): {_per_axis(parts.instrument)}"
    if not np.isfinite(parts.visits).all():
        return
    whose = "arm" if told else "arm and instrument together (no visit was read twice)"
    yield f"{whose}, from one side (between visits): {_per_axis(parts.visits)}"
    if np.isfinite(parts.sides).all():
        both = _per_axis(parts.visits + parts.sides)
        apart = checks.between_sides_mm(found.rows.read)
        yield f"{whose}, from all sides: {both}; sides are up to {apart:.3g} mm apart"


def _of_iso(found: Found) -> Iterator[str]:
    """ISO 9283's repeatability, and what it lacks of that test."""
    mean_mm, rp_mm = checks.pooled_rp(found.rows.read)
    if math.isnan(rp_mm):
        return
    told = [each for each in found.groups if not math.isnan(each.rp_mm)]
    worst = max(told, key=lambda each: each.rp_mm)
    fewest = min(each.visits for each in told)
    few = "" if fewest >= _USUAL_VISITS else f"; it asks for {_USUAL_VISITS} visits, not {fewest}"
    yield (
        f"ISO 9283 RP: {rp_mm:.3g} mm over all poses (mean distance {mean_mm:.3g} mm and three "
        f"standard deviations), {worst.rp_mm:.3g} mm at pose {found.rows.poses[worst.pose]}{few}"
    )


def _of_noise(noise: Noise) -> str:
    """What one reading of a campaign carries."""
    low, high = checks.limits(noise.std_mm, noise.freedom)
    one = slice(0, 1) if noise.is_even else slice(0, 3)
    each = [
        f"{std:.3g} mm (95 %: {least:.3g} to {most:.3g})"
        for std, least, most in zip(noise.std_mm[one], low[one], high[one], strict=True)
    ]
    said = f"{each[0]} per axis" if noise.is_even else f"x {each[0]}, y {each[1]}, z {each[2]}"
    return f"noise of a campaign's reading: {said}, {noise.freedom:.0f} degrees of freedom"


def _remarks(found: Found) -> Iterator[str]:
    """What has to be known of the noise before it is relied on, a sentence each."""
    rows, noise = found.rows, found.noise
    if noise is not None:
        yield from _of_axes(noise)
        yield from _of_freedom(noise)
        if noise.rounded.any():
            axes = "" if noise.is_even else f" along {', '.join(np.array([*'xyz'])[noise.rounded])}"
            yield (
                f"values stand in steps of {max(rows.resolution_mm):.3g} mm, and scatter less than "
                f"their rounding{axes}: the noise is taken as a step over the root of 12, which "
                "repeats do not average out; read off more digits"
            )
    if found.poses_differ:
        yield (
            f"{_of_poses(found)}. A campaign takes one noise, which is too small there: state that "
            "of such poses with --noise-mm"
        )
    if noise is not None and rows.sides is None:
        yield (
            "no column says from which side poses were approached: if it was always the same, the "
            "noise of a campaign that comes from all sides is larger"
        )
    far = checks.far_off(rows.read)
    if far.size:
        said = first_few([rows.row_names[each] for each in far])
        yield (
            f"far from the others of its pose: {said}. If something went wrong there, leave the "
            "row out and say so; as it is, it makes the noise large"
        )
    if noise is not None:
        yield from _of_time(found)


def _of_poses(found: Found) -> str:
    """That poses scatter differently, and which most; empty where that is not shown."""
    if not found.poses_differ:
        return ""
    worst = int(np.nanargmax(found.ratio))
    return (
        f"poses scatter differently (probability {found.by_pose:.2g} by chance): pose "
        f"{found.rows.poses[worst]} {found.ratio[worst]:.2f} times as much as all"
    )


def _of_axes(noise: Noise) -> Iterator[str]:
    if noise.is_even:
        return
    yield (
        f"axes may differ (probability {noise.by_axis:.2g} by chance): the noise is a covariance, "
        "in the frame of these readings, and each direction has the degrees of freedom of one axis"
    )


def _of_freedom(noise: Noise) -> Iterator[str]:
    if noise.freedom >= ENOUGH:
        return
    more = math.ceil((ENOUGH - noise.freedom) / (3.0 if noise.is_even else 1.0))
    few = f"fewer than {FEWEST}, the least that bounds are made of" if noise.freedom < FEWEST else (
        f"{ENOUGH} are asked for"
    )  # fmt: skip
    yield (
        f"{noise.freedom:.0f} degrees of freedom: {few}. About {more} more returns to poses make "
        f"{ENOUGH}: 20 poses, three visits each, are enough"
    )


def _of_time(found: Found) -> Iterator[str]:
    """Whether the readings were back to back, and so understate a day."""
    if found.span_h < _A_DAY_H:
        yield (
            f"readings of a pose lie within {60.0 * found.span_h:.0f} minutes (median): they "
            "understate a day, over which hall, arm and instrument warm up"
        )
    elif math.isnan(found.span_h):
        row = "; those of each pose follow each other in the file" if found.rows.in_a_row else ""
        yield (
            f"no column says when the readings were taken{row}: back to back they understate a "
            "day, over which hall, arm and instrument warm up"
        )


def _per_axis(covariance_mm2: np.ndarray) -> str:
    std = np.sqrt(np.diag(covariance_mm2))
    each = ", ".join(f"{value:.2g}" for value in std)
    return f"{per_axis_mm(std):.3g} mm per axis (x, y, z: {each})"
