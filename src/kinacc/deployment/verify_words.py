"""What a few new poses say of a calibration, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kinacc.artifacts.error_models import model_name
from kinacc.deployment.handful import DOUBLED, LEAST_HELD_OUT, LEVEL
from kinacc.deployment.verify import FAILS, FEW_HELD_OUT, OPEN, Level, Verdict


def of_verdict(found: Verdict, model: str, moved: Sequence[str], units: Sequence[str]) -> list[str]:
    """Errors and their limit, what these poses and others show, and the verdict; ``units`` (k,)."""
    return [*_beside_chance(found, model, moved), _verdict(found), *_power(found, units)]


def _beside_chance(found: Verdict, model: str, moved: Sequence[str]) -> Iterator[str]:
    if found.here is not None:
        yield f"{model_name(model)} where it was measured: {_level(found.here)}"
    if found.held is None:
        if found.held_out is not None:
            yield f"at its held-out poses: {_level(found.held_out)}"
        return
    fitted = f", after a fit of {' and '.join(moved)} to each" if moved else ""
    yield (
        f"where nothing has changed, {_poses(found.here.configurations)} have a mean of "
        f"{found.held.expected_mm:.4g} mm, and of 100 such handfuls {_passing()} have at most "
        f"{found.held.limit_mm:.4g} mm ({found.held_out.configurations} held-out configurations, "
        f"dealt out at random{fitted})"
    )


def _power(found: Verdict, units: Sequence[str]) -> Iterator[str]:
    """Sizes of changes that these poses and other numbers of them show, as a table."""
    known = [] if found.seen is None else [found.seen]
    if not known and not found.table:
        return
    yield "what is seen in four of five cases: errors as many times as large, or one joint offset"
    names = [f"joint {joint} {unit}" for joint, unit in enumerate(units, 1)]
    rows = [["poses", "errors times", *names]]
    for each in (*known, *found.table):
        numbers = [each.factor, *each.joints]
        poses = f"these {each.poses}" if each is found.seen else str(each.poses)
        rows.append([poses, *(f"{n:.2g}" if n < np.inf else "-" for n in numbers)])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  " + "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
    if any("-" in row for row in rows):
        yield "  - : moves the target little, or as what is fitted anew does"


def _verdict(found: Verdict) -> str:
    """The verdict as one sentence."""
    if found.says == OPEN:
        needed = ""
        if found.least is not None:
            needed = f"; it takes {_poses(found.least)} to show errors {DOUBLED:g} times as large"
        if found.reason == FEW_HELD_OUT:
            needed = f"; it takes {_poses(LEAST_HELD_OUT)}"
        return f"verdict: cannot be told from these readings: {found.reason}{needed}"
    share = found.held.probability
    if found.says == FAILS:
        times = found.held.mean_mm / found.held.expected_mm
        return (
            f"verdict: fails: the mean error is {times:.3g} times that of poses where nothing has "
            f"changed, of which {100 * share:.2g} % have as much; below {100 * LEVEL:g} % it fails"
        )
    return (
        f"verdict: passes: where nothing has changed {100 * share:.2g} % of such handfuls have as "
        f"much; below {100 * LEVEL:g} % it fails"
    )


def _passing() -> str:
    return f"{100 * (1.0 - LEVEL):.0f}"


def _poses(count: int | None) -> str:
    return f"{count} configuration{'s' * (count != 1)}"


def _level(level: Level) -> str:
    """How large the errors are, in words."""
    return (
        f"mean {level.mean_mm:.4g} mm, 99 % at most {level.quantile_99_mm:.4g} mm "
        f"({level.readings} readings of {_poses(level.configurations)})"
    )
