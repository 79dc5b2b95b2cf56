"""Tables and text of a campaign's report."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from kinacc import __version__
from kinacc.assess.adaptive import Campaign
from kinacc.assess.conformity import decide
from kinacc.assess.limits import VISITS as FUTURE
from kinacc.assess.statement import MEAN, REGION
from kinacc.campaign import consistency, nearness, words
from kinacc.campaign.folder import Opened
from kinacc.campaign.instrument import noise
from kinacc.campaign.journal import JOURNAL
from kinacc.campaign.reading import covariance_mm2
from kinacc.campaign.state import State, sayable
from kinacc.config.names import in_markdown
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

_STATEMENTS = 150  # stated at so many moments of a campaign, at most
_LARGEST = 10
_SIZES = ("error", "lower", "upper")
_DECIMALS = 3  # of mm, as shown
_UNLIKELY = 3.0  # standard deviations of a mean reading


def tables(opened: Opened, progress: Callable | None = None) -> tuple[State, dict[str, Columns]]:
    """The state of a campaign and its tables ``campaign_points``, ``_readings``, ``_bounds``."""
    total = len(opened.state().told)
    pause = max(-(-total // _STATEMENTS), 1)
    rows: list[dict] = []
    done = iter(progress(range(total), "readings replayed")) if progress else iter(range(total))

    def watch(campaign: Campaign, _) -> None:
        next(done, None)
        count, visited = campaign.ledger.taken, campaign.ledger.visited
        if count % pause == 0 or count == total:
            rows.extend(_said(each, count, len(visited)) for each in sayable(opened.plan, campaign))

    state = opened.state(watch)
    for _ in done:
        pass
    if not rows:
        rows = [_said(each, 0, 0) for each in state.statements()]
    return state, {
        "campaign_points": _points(state),
        "campaign_readings": _readings(state),
        "campaign_bounds": columns_of("campaign_bounds", rows),
    }


def _said(said, count: int, visited: int) -> dict[str, object]:
    return {
        "readings": count,
        "points_measured": visited,
        "target": said.target,
        "share": said.share,
        "value_mm": said.value_mm,
        "lower_mm": said.lower_mm,
        "upper_mm": said.upper_mm,
        "excepted": said.excepted,
        "confidence": said.confidence,
        "assumption": words.reason(said.assumption),
        "withheld": words.reason(said.withheld),
    }


def _points(state: State) -> Columns:
    points = state.plan.points
    order = [*map(int, state.rows), *state.left_out]
    means, limits = means_of(state), limits_of(state)
    directions = np.zeros(points.joints.shape, np.int8)
    if points.directions is not None:
        directions = points.directions
    rows = []
    for place, point in enumerate(order, start=1):
        mean, noise, count = means.get(point, (np.full(3, math.nan), math.nan, 0))
        lower, upper = limits.get(point, (math.nan, math.nan))
        row = {
            "point": points.label[point],
            "visit": math.nan if point in state.left_out else place,
        }
        row |= {f"q{i + 1}": value for i, value in enumerate(points.joints[point])}
        row |= {f"s{i + 1}": int(value) for i, value in enumerate(directions[point])}
        row |= {f"{axis}_mm": points.modelled_mm[point, i] for i, axis in enumerate("xyz")}
        row |= {"readings": count}
        row |= {f"e{axis}_mm": mean[i] for i, axis in enumerate("xyz")}
        row |= {"error_mm": float(np.linalg.norm(mean)), "noise_mm": noise}
        row |= {"lower_mm": lower, "upper_mm": upper}
        rows.append({**row, "left_out": state.left_out.get(point)})
    return columns_of("campaign_points", rows)


def _readings(state: State) -> Columns:
    plan = state.plan
    used = {each.number: place for place, each in enumerate(state.told, start=1)}
    rows = []
    void = {each.number: reason for each, reason in state.struck}
    struck = (each for each, _ in state.struck)
    for each in sorted((*state.told, *state.in_hand, *struck), key=lambda known: known.number):
        reading = each.reading
        instrument = plan.instrument(reading.instrument)
        covariance = covariance_mm2(plan, reading)
        row = {
            "reading": each.number,
            "point": plan.points.label[reading.point],
            "used": used.get(each.number, math.nan),
            "instrument": reading.instrument,
            "frame": instrument.frame,
        }
        row |= {f"{axis}_mm": reading.position_mm[i] for i, axis in enumerate("xyz")}
        row |= {f"e{axis}_mm": each.error_mm[i] for i, axis in enumerate("xyz")}
        row |= {
            "error_mm": float(np.linalg.norm(each.error_mm)),
            "noise_mm": math.sqrt(float(np.trace(covariance)) / 3.0),
            "struck": void.get(each.number),
        }
        rows.append(row)
    return columns_of("campaign_readings", rows)


def means_of(state: State) -> dict[int, tuple[np.ndarray, float, int]]:
    """Mean error (3,), its noise per axis and number of readings of every point used."""
    ledger = state.campaign.ledger
    return {
        int(state.rows[row]): (
            ledger.mean_mm[row],
            float(ledger.noise_mm[row]),
            int(ledger.count[row]),
        )
        for row in ledger.visited
    }


def limits_of(state: State) -> dict[int, tuple[float, float]]:
    """Lower and upper limit on every measured point's size, as the assessor has them."""
    limits = state.campaign.point_limits()
    return {int(state.rows[row]): each for row, each in limits.items()}


def markdown(opened: Opened, state: State, found: dict[str, Columns], picture: str) -> str:
    """The report as text."""
    plan = state.plan
    about = {key: in_markdown(value) for key, value in plan.about.items()}
    lines = [
        f"# Largest error of {about['robot']}, {about['model']} model of {about['calibration']}",
        "",
        *(f"- {each}" for each in words.statements(state)),
        *_nearness(state),
        *(f"- {in_markdown(each)}" for each in words.begun_against(plan)),
        *(f"- {in_markdown(each)}" for each in read_above(state, found["campaign_points"])),
        "",
    ]
    if plan.limits.tolerance_mm is not None:
        lines += ["## Conformity", "", *_conformity(state), ""]
    lines += [f"![sizes of the errors, and the bounds as they grew]({picture})", ""]
    lines += ["## What was measured", "", *(f"- {each}" for each in facts(opened, state)), ""]
    points = found["campaign_points"]
    shown = largest_read(points)
    lines += ["## Largest errors", "", *_largest(points, shown), ""]
    lines += beyond_limits(points, shown)
    lines += ["## What the bounds rest on", "", *(f"- {each}" for each in grounds(state)), ""]
    lines += [
        "## What this report was made of",
        "",
        *(f"- {each}" for each in made_of(opened, state)),
    ]
    return "\n".join(lines) + "\n"


def _nearness(state: State) -> list[str]:
    """How near the bounds are, as a list within the list."""
    lines = []
    for head, told in nearness.told(state):
        lines += [f"- {head}:", *(f"  - {each}" for each in told)]
    return lines


def _conformity(state: State) -> list[str]:
    tolerance = state.plan.limits.tolerance_mm
    lines = [f"Largest error allowed: {tolerance:g} mm.", ""]
    for said in state.statements():
        found = decide(said, tolerance)
        line = f"- {words.target(said)}: **{found.verdict}**; {words.reason(found.reason)}"
        if math.isfinite(found.guard_band_mm):
            line += (
                f" (guard band {found.guard_band_mm:.3f} mm, acceptance limit "
                f"{found.acceptance_limit_mm:.3f} mm, risk at most {found.risk:.1%})"
            )
        lines.append(line)
    lines += [
        "",
        "Accepted where the upper bound is within the tolerance, rejected where the lower bound is "
        "beyond it: guarded acceptance and rejection of JCGM 106:2012, the rule of ISO 14253-1. "
        "Between them nothing is decided. The guard band is how far "
        "the estimate has to stay below the tolerance; the risk is that of either being wrong.",
    ]
    return lines


def made_of(opened: Opened, state: State) -> list[str]:
    """Digests, number of readings, version and settings: ``kinacc campaign verify`` takes them."""
    told = {key: value for key, value in vars(state.plan.assessor).items() if value is not None}
    settings = ", ".join(f"{key}={value}" for key, value in told.items())
    entries = opened.journal.entries
    files = {str(each["file"]): each.get("path") for each in entries if "file" in each}
    readings = f"{state.numbered} reading{'' if state.numbered == 1 else 's'}"
    return [
        f"campaign {opened.digest}, kinacc {__version__}",
        f"{readings}; SHA-256 of {JOURNAL} {opened.journal.sha256()}",
        *(f"{path or 'a measured file'}: digest {digest}" for digest, path in files.items()),
        f"{state.plan.assessor.name}: {settings}",
    ]


def facts(opened: Opened, state: State, written: Callable[[str], str] = in_markdown) -> list[str]:
    """What was measured, with what and when, a line each; ``written``: as names are shown."""
    plan = state.plan
    visited = len({each.reading.point for each in state.told})
    source = written(plan.about["candidates"])
    joints = f"{len(plan.points) - len(state.left_out)} candidates ({source})"
    lines = [
        f"{len(state.told)} readings of {plan.assessor.measurements} at {visited} of {joints}, "
        f"order drawn with seed {plan.seed}",
        f"point measured: {written(plan.about['point'])}",
        *(
            f"instrument {written(each.name)}: {noise(each)}, {each.frame} frame"
            for each in plan.instruments
        ),
        f"assessor {plan.assessor.name}: {(type(plan.assessor).__doc__ or '').splitlines()[0]}",
    ]
    if times := opened.recorded:
        lines.append(f"recorded from {min(times)} to {max(times)}")
        if sorted(times) != list(times):
            lines.append("the times of its entries are not in order: a clock was set in between")
    if state.in_hand:
        lines.append(f"{len(state.in_hand)} readings were taken and not asked for: not used")
    large = sum(np.linalg.norm(each.error_mm) > plan.limits.implausible_mm for each in state.told)
    if large:
        lines.append(
            f"{large} readings beyond {plan.limits.implausible_mm:g} mm were taken on request"
        )
    lines += map(written, words.not_counted(state))
    lines += [*consistency.remarks(state), *words.of_frame(state), *words.of_the_noise(state)]
    return [*lines, *map(written, words.suspicious(state))]


def read_above(state: State, points: Columns) -> list[str]:
    """What is to be said where points read more than an upper bound that is stated."""
    size = _as_shown(points["error_mm"])
    measured = int(np.sum(~np.isnan(size)))
    lines = []
    for said in words.distinct(state):
        upper_mm = round(said.upper_mm, _DECIMALS)
        above = np.flatnonzero(size > upper_mm)
        if not above.size:
            continue
        top = above[np.argmax(size[above])]
        noise_mm, count = float(points["noise_mm"][top]), int(points["readings"][top])
        if said.target == REGION:
            why = f"the bound leaves out {1.0 - said.share:.1%} of the region"
        elif size[top] - said.upper_mm > _UNLIKELY * noise_mm:
            why = (
                f"its noise, {noise_mm:.3f} mm per axis, does not explain that: the noise "
                "is stated too small, or this is one of the few campaigns the confidence allows to "
                "be wrong"
            )
        else:
            readings = "1 reading" if count == 1 else f"{count} readings"
            why = (
                "the bound is on the error that stays when a pose is measured again, and this is "
                f"the mean of {readings} with noise of {noise_mm:.3f} mm per axis"
            )
        lines.append(
            f"At most {said.upper_mm:.3f} mm for {words.target(said)}: {above.size} of the "
            f"{measured} measured points read more than that, point {points['point'][top]} the "
            f"most, {size[top]:.3f} mm; {why}."
        )
    return lines


def _as_shown(values: np.ndarray) -> np.ndarray:
    return np.round(np.asarray(values, dtype=float), _DECIMALS)


def largest_read(points: Columns) -> np.ndarray:
    """Rows of the largest errors read, largest first."""
    size = np.asarray(points["error_mm"], dtype=float)
    order = np.argsort(-np.where(np.isnan(size), -1.0, size), kind="stable")[:_LARGEST]
    return order[~np.isnan(size[order])]


def _largest(points: Columns, shown: np.ndarray) -> list[str]:
    lines = ["| point | readings | error mm | at least mm | at most mm |", "|---|---|---|---|---|"]
    for row in shown:
        size, lower, upper = (float(points[f"{name}_mm"][row]) for name in _SIZES)
        label, readings = in_markdown(points["point"][row]), int(points["readings"][row])
        lines.append(f"| {label} | {readings} | {size:.3f} | {lower:.3f} | {upper:.3f} |")
    return lines


def beyond_limits(
    points: Columns,
    shown: np.ndarray,
    written: Callable[[str], str] = in_markdown,
) -> list[str]:
    """What is to be said where rows that are shown read more than their limit, or limits cross."""
    size, lower, upper = (_as_shown(points[f"{name}_mm"])[shown] for name in _SIZES)
    once = np.asarray(points["readings"], dtype=float)[shown] == 1.0

    def named(rows: np.ndarray) -> str:
        return ", ".join(written(points["point"][row]) for row in shown[rows])

    lines = []
    if (above := size > upper).any():
        text = (
            f"Read above their own limit: {named(above)}. A limit is on the error that stays when "
            "a pose is measured again, and the narrowest of those at several looks; the "
            "error shown is the mean of what was read, with its noise."
        )
        if (quiet := above & once).any():
            text += (
                f" Read once, and less than the noise stated nearly always brings: {named(quiet)}; "
                "the noise may be stated too large."
            )
        lines += [text, ""]
    if (crossed := lower > upper).any():
        lines += [
            f"Limits that contradict each other: {named(crossed)}. Either the noise is stated too "
            "small, or something moved between the readings.",
            "",
        ]
    return lines


def grounds(state: State) -> list[str]:
    """What the bounds rest on, a line each."""
    lines = [
        "readings are normal about the true position, with the covariance stated"
        f"{words.told_factor(state.plan)}: it holds the instrument, its target, and how well the "
        "arm repeats a pose",
        "readings are independent of each other; what the instrument gets wrong every time at a "
        "pose counts as an error of the arm",
        "candidates were drawn without regard to their errors, and none was left out for its error",
        *_by_settings(state),
        "readings in the instrument's frame are brought to the robot's base as the calibration "
        "placed it: the instrument has not moved since, or was set up anew in that frame",
    ]
    if all(each.frame == "base" for each in state.plan.instruments):
        lines.pop()
    return lines + sorted(
        {words.reason(each.assumption) for each in state.statements() if each.assumption}
    )


def _by_settings(state: State) -> list[str]:
    """What is meant, guarded against and allowed for, and what would go unseen without."""
    told = vars(state.plan.assessor)
    meant = "the error meant is the deterministic one: what stays when a pose is measured again"
    if told.get("error_of", MEAN) != MEAN:
        arm = "all of the noise" if told["arm_mm"] is None else f"{told['arm_mm']:g} mm per axis"
        meant = (
            f"the error meant is what {FUTURE:.0%} of future visits to the worst pose keep; the "
            f"arm's own scatter is {arm}"
        )
    rate, allowed_mm = told.get("wrong_rate", 0.0), told.get("allowance_mm", 0.0)
    lines = [
        meant,
        f"at most {rate:.1%} of the readings are wrong, each at random" if rate
        else "no reading went wrong without standing apart from others of its pose",
        f"what no repeat sees (frame, tool offset, scale: at most {allowed_mm:g} mm) is allowed for"
        if allowed_mm
        else "nothing is allowed for what no repeat sees: frame, tool offset, the instrument's "
        "scale",
    ]  # fmt: skip
    lines.append(_of_the_frame(told))
    if "confidence" in told:
        sure = told["confidence"] - rate
        lines.append(
            f"each bound holds with {sure:.0%} confidence, both together with "
            f"{max(2.0 * sure - 1.0, 0.0):.0%} at least"
        )
    return lines


def _of_the_frame(told: Mapping[str, object]) -> str:
    """What the bounds rest on where the frame may move, by an assessor's settings."""
    if not told.get("references", 0):
        return "nothing drifted or moved: no reference poses are read again that would show it"
    return "nothing drifted or moved so little that the reference poses do not show it"
