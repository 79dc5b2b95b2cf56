"""Tables of a campaign's report, and the facts it states."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from kinacc import __version__
from kinacc.assess.adaptive import Campaign
from kinacc.assess.limits import VISITS as FUTURE
from kinacc.assess.statement import MEAN
from kinacc.campaign import consistency, words
from kinacc.campaign.folder import Opened
from kinacc.campaign.instrument import noise
from kinacc.campaign.journal import JOURNAL
from kinacc.campaign.reading import covariance_mm2
from kinacc.campaign.state import State, sayable
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

_STATEMENTS = 150  # stated at so many moments of a campaign, at most


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


def facts(opened: Opened, state: State) -> list[str]:
    """What was measured, with what and when, a line each."""
    plan = state.plan
    visited = len({each.reading.point for each in state.told})
    joints = f"{len(plan.points) - len(state.left_out)} candidates ({plan.about['candidates']})"
    lines = [
        f"{len(state.told)} readings of {plan.assessor.measurements} at {visited} of {joints}, "
        f"order drawn with seed {plan.seed}",
        f"point measured: {plan.about['point']}",
        *(
            f"instrument {each.name}: {noise(each)}, {each.frame} frame"
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
    lines += words.not_counted(state)
    lines += [*consistency.remarks(state), *words.of_frame(state), *words.of_the_noise(state)]
    return [*lines, *words.suspicious(state)]


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
