"""Where a campaign stands: its plan, its readings given to the assessor again, and their scatter.

The assessor gets readings in the order in which it requests them, whatever the order in which they
were taken. One that it has not requested stays in hand. What it requests never depends on readings
in hand, so measuring ahead, or importing a whole file, does not bias anything.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AwareDatetime,
    BaseModel,
    Field,
    NonNegativeInt,
    PositiveInt,
    TypeAdapter,
)
from scipy.special import chdtrc

from kinacc.assess.adaptive import Campaign
from kinacc.assess.statement import MEASURED, Reason, Statement
from kinacc.campaign.instrument import INSTRUMENT, Numbers, covariance_of
from kinacc.campaign.plan import Plan
from kinacc.errors import InputError, Problem, gathered, input_error, refuse

_FARTHEST_MM = 1e6  # no instrument measures an arm from a kilometre away
_USUAL_READINGS = 10  # that show which size is usual
_UNUSUAL, _FEWEST_SIGMAS = 6.0, 10.0  # times the median size, and standard deviations
SUSPICIOUS = 1e-3  # probability of readings that the stated noise does not explain


@dataclass(frozen=True)
class Reading:
    """One reading as it goes into the journal.

    ``position_mm`` (3,) in the frame of ``instrument``; ``joints`` (k,) as the controller reported
    them (rad, mm), None where not noted; ``std``: 1, 3 or 9 numbers as text where the noise of this
    reading is not the instrument's.
    """

    point: NonNegativeInt
    position_mm: Numbers
    instrument: str
    joints: Numbers | None = None
    std: str | None = None

    @property
    def digits(self) -> tuple[object, ...]:
        """Point, instrument and position to the last digit."""
        return self.point, self.instrument, *self.position_mm.tolist()


class _Entry(BaseModel):
    at: AwareDatetime | None = None


class Readings(_Entry):
    """Entry of the journal: readings that are taken together.

    ``path`` is the place of their file from the campaign's folder, None of a single reading.
    """

    kind: Literal["readings"] = "readings"
    readings: list[Reading]
    path: str | None = None


class LeaveOut(_Entry):
    """Entry of the journal: a point that is not measured."""

    kind: Literal["leave_out"] = "leave_out"
    point: NonNegativeInt
    reason: str


class Strike(_Entry):
    """Entry of the journal: a reading that is void."""

    kind: Literal["strike"] = "strike"
    reading: PositiveInt
    reason: str


Entry = Readings | LeaveOut | Strike
_ENTRY: TypeAdapter[Entry] = TypeAdapter(Annotated[Entry, Field(discriminator="kind")])


def error_mm(plan: Plan, reading: Reading) -> np.ndarray:
    """Return measured minus modelled position (3,), robot's base."""
    measured = reading.position_mm
    if plan.instrument(reading.instrument).frame == INSTRUMENT:
        measured = plan.to_base.rotation @ measured + plan.to_base.position_mm
    return measured - plan.points.position_mm(reading.point, reading.joints)


def covariance_mm2(plan: Plan, reading: Reading) -> np.ndarray:
    """Return the covariance (3, 3) of the reading in the robot's base."""
    unplanned = unplanned_mm2(plan, reading)
    return plan.covariance_mm2[reading.point] if unplanned is None else unplanned


def unplanned_mm2(plan: Plan, reading: Reading) -> np.ndarray | None:
    """Return the covariance (3, 3) in the robot's base; None where it is the planned one."""
    instrument = plan.instrument(reading.instrument)
    if reading.std is not None:
        instrument = instrument.of_reading(reading.std)
    elif instrument is plan.instruments[0]:
        return None
    return instrument.in_base(plan.to_base, plan.points.modelled_mm[[reading.point]])[0]


def point_at(plan: Plan, joints: np.ndarray) -> int | None:
    """Return the candidate whose joints all lie within the tolerance of these (k,), or None."""
    apart = np.abs((joints - plan.points.joints) / _tolerance(plan)).max(axis=1)
    nearest = int(np.argmin(apart))
    return nearest if apart[nearest] <= 1.0 else None


def faults_of(plan: Plan, reading: Reading, where: str) -> list[Problem]:
    """Return why numbers cannot be a reading."""
    problems: list[Problem] = []
    for name, values, count in (
        ("measured position", reading.position_mm, 3),
        ("joints", reading.joints, len(plan.slides)),
    ):
        if values is None:
            continue
        if values.shape != (count,) or not (np.abs(values) <= _FARTHEST_MM).all():
            allowed = f"{count} numbers within {_FARTHEST_MM:g}"
            problems.append(Problem(where, f"{name} {values.tolist()}", allowed))
    if reading.std is not None:
        with gathered(problems):
            covariance_of(reading.std, f"{where}, standard deviation")
    return problems


def _tolerance(plan: Plan) -> np.ndarray:
    # A sliding joint may be off by as many mm as a turning one moves a point one metre away.
    return plan.limits.joint_rad * np.where(plan.slides, 1e3, 1.0)


@dataclass(frozen=True)
class Taken:
    """A reading in the journal: its number (from 1) and its error (3,).

    ``path`` of its file, None of a single reading; ``struck``: why it is void, None where it is
    not.
    """

    number: int
    reading: Reading
    error_mm: np.ndarray
    path: str | None
    struck: str | None = None


@dataclass
class State:
    """A campaign with its readings.

    ``rows`` are points in the order in which the assessor numbers them. ``requested`` is the point
    it requests next, None for none. ``taken`` are all readings in the journal, ``used`` those that
    the assessor requested, in its order. ``left_out``: points with the reason.
    """

    plan: Plan
    campaign: Campaign
    rows: np.ndarray
    taken: list[Taken]
    used: list[Taken]
    requested: int | None
    left_out: Mapping[int, str]

    @property
    def readings(self) -> list[Taken]:
        """Readings taken, without those struck."""
        return [item for item in self.taken if item.struck is None]

    @property
    def struck(self) -> list[Taken]:
        """Readings declared void."""
        return [item for item in self.taken if item.struck is not None]

    def statements(self) -> tuple[Statement, ...]:
        """Return the statements that the readings support."""
        return sayable(self.campaign)

    def ahead(self) -> list[int]:
        """Return points to be read whatever is read, in order, planned revisits in their places."""
        have = Counter(item.reading.point for item in self.readings)
        wanted = []
        for point in self.rows[list(self.campaign.visit())].tolist():
            if have[point]:
                have[point] -= 1
            else:
                wanted.append(point)
        return wanted


def problems_of(state: State, reading: Reading, where: str, most_mm: float) -> list[Problem]:
    """Return everything that is wrong with a reading; errors above ``most_mm`` are implausible."""
    plan = state.plan
    if problems := faults_of(plan, reading, where):
        return problems
    label, points = plan.points.label[reading.point], plan.points
    if reading.point in state.left_out:
        problems.append(Problem(where, f"point {label} was left out of the campaign"))
    if reading.joints is not None:
        off, tolerance = np.abs(reading.joints - points.joints[reading.point]), _tolerance(plan)
        worst = int(np.argmax(off / tolerance))
        if off[worst] > tolerance[worst]:
            unit, factor = ("mm", 1.0) if plan.slides[worst] else ("deg", 180.0 / math.pi)
            message = f"joint {worst + 1} is {off[worst] * factor:.4f} {unit} from point {label}"
            known = point_at(plan, reading.joints)
            fix = "" if known is None else f"these joints are point {points.label[known]}"
            allowed = f"at most {tolerance[worst] * factor:g} {unit}"
            return [*problems, Problem(where, message, allowed, fix)]
    size = float(np.linalg.norm(error_mm(plan, reading)))
    if size > most_mm:
        fix = (
            "check pose, target, unit and frame, and read again; --accept-implausible takes a "
            "reading that stands (dropping it for its size makes the bound wrong)"
        )
        message = f"{size:.3f} mm from the model at point {label}"
        problems.append(Problem(where, message, f"at most {most_mm:.3g} mm", fix))
    return problems


def most_plausible_mm(state: State, rows: Iterable[Reading] = ()) -> float:
    """Return the largest error that is plausible after the readings taken, and further ``rows``."""
    plan = state.plan
    with np.errstate(over="ignore", invalid="ignore"):
        errors = [item.error_mm for item in state.readings] + [error_mm(plan, row) for row in rows]
        sizes = np.linalg.norm(np.reshape(errors, (-1, 3)), axis=1)
    sizes = sizes[np.isfinite(sizes)]
    if len(sizes) < _USUAL_READINGS:
        return plan.limits.implausible_mm
    sigma = math.sqrt(np.trace(plan.covariance_mm2, axis1=1, axis2=2).max())
    unusual = max(_UNUSUAL * float(np.median(sizes)), _FEWEST_SIGMAS * sigma)
    return min(plan.limits.implausible_mm, unusual)


def sayable(campaign: Campaign) -> tuple[Statement, ...]:
    """Return the statements of a campaign, without those that its visit does not support yet.

    Part of the first visit, which is made in order of travel, is no random sample: until it is
    complete, nothing is stated about points that were not measured. Readings that all equal the
    prediction to the last digit are none: whatever the errors, noise keeps them apart.
    """
    stated, ledger = campaign.statements(), campaign.ledger
    missing = campaign.first - len(ledger.visited)
    if ledger.taken and not ledger.sizes_mm().any():
        reason, spared = Reason("predicted", {"read": ledger.taken}), []
    else:
        reason = Reason("first_visit_by_travel", {"left": missing})
        spared = [
            item for item in stated if missing <= 0 or item.target == MEASURED or item.withheld
        ]
    return tuple(
        item if item in spared else Statement(item.target, share=item.share, withheld=reason)
        for item in stated
    )


def restore(plan: Plan, entries: Iterable[Mapping[str, Any]], where: str = "journal") -> State:
    """Return the state after the entries of a journal; the assessor gets readings as it requests.

    Parameters
    ----------
    plan : Plan
        What the campaign fixes.
    entries : iterable of mapping
        Entries of its journal.
    where : str
        Name of the journal in problems.

    Returns
    -------
    State

    Raises
    ------
    InputError
        Naming the line of an entry that cannot be read.
    """
    taken: list[Taken] = []
    left_out: dict[int, str] = {}
    for line, content in enumerate(entries, start=1):
        try:
            entry = _ENTRY.validate_python(content)
            if isinstance(entry, Readings):
                for reading in entry.readings:
                    refuse(faults_of(plan, reading, f"point {reading.point}"))
                    taken.append(
                        Taken(len(taken) + 1, reading, error_mm(plan, reading), entry.path)
                    )
            elif isinstance(entry, LeaveOut):
                if entry.point >= len(plan.points):
                    raise ValueError(f"point {entry.point}")
                left_out[entry.point] = entry.reason
            else:
                place = entry.reading - 1
                taken[place] = replace(taken[place], struck=entry.reason)
        except (ArithmeticError, InputError, LookupError, TypeError, ValueError) as error:
            message = f"is no entry of this campaign: {' '.join(str(error).split())[:200]}"
            fix = "bring the file back from a copy"
            raise input_error(f"{where}, line {line}", message, fix=fix) from None
    rows = plan.visiting(frozenset(left_out))
    waiting = defaultdict[int, deque[Taken]](deque)
    for item in taken:
        if item.struck is None:
            waiting[item.reading.point].append(item)
    campaign = plan.assessor.begin(plan.candidates(rows))
    used: list[Taken] = []
    # The assessor is asked before every reading, as it was then: some remember when they were.
    while (row := campaign.next()) is not None and (queue := waiting[int(rows[row])]):
        used.append(item := queue.popleft())
        campaign.record(row, item.error_mm, unplanned_mm2(plan, item.reading))
    requested = None if row is None else int(rows[row])
    return State(plan, campaign, rows, taken, used, requested, left_out)


@dataclass(frozen=True)
class Scatter:
    """Root of chi-square over its degrees of freedom (1 on average where the noise is as stated).

    ``probability`` of so much scatter or more by chance.
    """

    ratio: float
    freedom: int
    probability: float

    @property
    def too_small(self) -> bool:
        """Whether the noise is overstated: bounds hold, wider than needed."""
        return 1.0 - self.probability < SUSPICIOUS


def scatter(state: State) -> Scatter | None:
    """Return the scatter of repeated readings that were requested; None where there are none."""
    repeats = state.campaign.repeats()
    if repeats is None or not repeats.freedom:
        return None
    return _scatter(float(repeats.squares.sum()), repeats.freedom)


def size_scatter(state: State) -> Scatter | None:
    """Return the size of all readings as scatter about the predictions; None without a reading.

    Errors make readings larger than noise alone would, never smaller: ``too_small`` contradicts
    the stated noise, whatever the errors are.
    """
    square, readings = 0.0, state.readings
    for item in readings:
        covariance = covariance_mm2(state.plan, item.reading)
        square += float(item.error_mm @ np.linalg.solve(covariance, item.error_mm))
    return _scatter(square, 3 * len(readings)) if readings else None


def _scatter(square: float, freedom: int) -> Scatter:
    return Scatter(math.sqrt(square / freedom), freedom, float(chdtrc(freedom, square)))
