"""What a few new poses say of a calibration, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kinacc.config.error_models import model_name
from kinacc.deployment.handful import DOUBLED, LEAST_HELD_OUT, LEVEL
from kinacc.deployment.verify import FAILS, FEW_HELD_OUT, OPEN, Level, Verdict

_KEPT = f"{100.0 * (1.0 - 0.5 * LEVEL):g} %"  # by each of the two sizes that are held


def of_verdict(found: Verdict, model: str, moved: Sequence[str], units: Sequence[str]) -> list[str]:
    """Errors and their limit, what these poses and others show, and the verdict; ``units`` (k,)."""
    return [*_beside_chance(found, model, moved), _verdict(found, units), *_power(found, units)]


def _beside_chance(found: Verdict, model: str, moved: Sequence[str]) -> Iterator[str]:
    if found.here is not None:
        yield f"{model_name(model)} where it was measured: {_level(found.here)}"
    if found.held is None:
        if found.held_out is not None:
            yield f"at its held-out poses: {_level(found.held_out)}"
        return
    fitted = f", {' and '.join(moved)} fitted to each" if moved else ""
    yield (
        f"where nothing has changed, {_poses(found.here.configurations)} have a mean of "
        f"{found.held.expected_mm:.4g} mm, and {_KEPT} of such handfuls at most "
        f"{found.held.limit_mm:.4g} mm ({found.held_out.configurations} held-out configurations, "
        f"dealt out at random{fitted})"
    )
    yield (
        f"offsets of the joints would explain {found.held.offsets_mm:.4g} mm rms of their errors; "
        f"of {_KEPT} of such handfuls at most {found.held.offsets_limit_mm:.4g} mm"
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


def _verdict(found: Verdict, units: Sequence[str]) -> str:
    """The verdict as one sentence."""
    if found.says == OPEN:
        needed = ""
        if found.least is not None:
            needed = f"; it takes {_poses(found.least)} to show errors {DOUBLED:g} times as large"
        if found.reason == FEW_HELD_OUT:
            needed = f"; it takes {_poses(LEAST_HELD_OUT)}"
        return f"verdict: cannot be told from these readings: {found.reason}{needed}"
    held = found.held
    chance = f"{100.0 * held.probability:.2g} %"
    if found.says == FAILS:
        why = []
        if held.mean_mm > held.limit_mm:
            why.append(f"the mean error is {held.mean_mm / held.expected_mm:.3g} times as large")
        if held.offsets_mm > held.offsets_limit_mm:
            unit = units[held.joint - 1]
            looks = f"an offset of joint {held.joint} by {held.offset:+.2g} {unit}"
            why.append(f"the errors look most like {looks}")
        return (
            f"verdict: fails: {', and '.join(why) or 'the errors are larger'}; where nothing has "
            f"changed {chance} of such handfuls go as far, and it fails at {100.0 * LEVEL:g} %"
        )
    return (
        f"verdict: passes: where nothing has changed {chance} of such handfuls go as far, and it "
        f"fails at {100.0 * LEVEL:g} %"
    )


def _poses(count: int | None) -> str:
    return f"{count} configuration{'s' * (count != 1)}"


def _level(level: Level) -> str:
    """How large the errors are, in words."""
    return (
        f"mean {level.mean_mm:.4g} mm, 99 % at most {level.quantile_99_mm:.4g} mm "
        f"({level.readings} readings of {_poses(level.configurations)})"
    )
