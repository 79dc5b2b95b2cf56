"""What the rest of a campaign is likely to bring, by simulation from what was read so far.

The true errors are taken as vectors drawn from one population: a mixture of normal distributions
of different widths, whose shares are fitted to the readings by maximum likelihood. That allows for
heavy tails, but for no dependence between neighbouring poses. It is a forecast: no bound rests on
it.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinacc.assess.adaptive import Campaign, Ledger
from kinacc.assess.conformity import ACCEPT, REJECT, UNDECIDED, decide
from kinacc.assess.simulate import carry_on, noisy
from kinacc.assess.statement import CANDIDATES, Reason, Statement
from kinacc.campaign import words
from kinacc.campaign.plan import Plan
from kinacc.campaign.reading import unplanned_mm2
from kinacc.campaign.simulate import quantiles, width_mm
from kinacc.campaign.state import State, sayable

FEWEST_POINTS = 8
_WIDTHS = 24  # of the mixture, in equal ratios
_ROUNDS = 60
_PSEUDO = 0.2  # points' worth of mass spread over the widths before any reading
_LOOKS = 12  # times a simulated campaign is asked for its statement
_FACTORS = (1.5, 2.0, 3.0, 5.0, 8.0)  # budgets tried where this one will not do
ENOUGH = 0.8  # share of simulated campaigns that makes a budget sufficient


@dataclass(frozen=True)
class Population:
    """Mixture of normal error vectors: standard deviations per axis (w,) and their shares (w,)."""

    scale_mm: np.ndarray
    share: np.ndarray


@dataclass(frozen=True)
class Forecast:
    """What simulated ends of a campaign have in common.

    ``width_mm``: 5, 50 and 95 % quantiles of the final distance between the bounds (infinite: no
    bound). ``reached``: share that comes as near as wanted within the budget, and ``more``:
    median number of further readings of those (None where hardly any does). ``budget``: the
    smallest of some larger budgets of a new campaign that is enough in at least 80 % (None: none
    was, or none was tried). ``decisions``: share by decision on the tolerance.
    """

    simulations: int
    left: int
    width_mm: tuple[float, float, float]
    wanted_mm: float | None = None
    reached: float | None = None
    more: int | None = None
    target: str = CANDIDATES
    budget: int | None = None
    tried: int | None = None
    decisions: dict[str, float] | None = None


def population(mean_mm: np.ndarray, noise_mm: np.ndarray) -> Population:
    """Fit the mixture to mean readings (n, 3) of noise (n,) per axis, by EM."""
    square = np.sum(mean_mm**2, axis=1)
    top = math.sqrt(float(square.max()) / 3.0) + 1e-12
    scale = np.geomspace(0.02 * top, 1.2 * top, _WIDTHS)
    likelihood = _likelihood(square, noise_mm, scale)
    share = np.full(_WIDTHS, 1.0 / _WIDTHS)
    for _ in range(_ROUNDS):
        part = likelihood * share
        share = (part / part.sum(axis=1, keepdims=True)).sum(axis=0) + _PSEUDO / _WIDTHS
        share /= share.sum()
    return Population(scale, share)


def draw_errors(
    known: Population, mean_mm: np.ndarray, noise_mm: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """True errors (m, 3) the points could have; points without readings have infinite noise."""
    read = np.isfinite(noise_mm)
    share = np.tile(known.share, (len(mean_mm), 1))
    square = np.sum(mean_mm[read] ** 2, axis=1)
    share[read] *= _likelihood(square, noise_mm[read], known.scale_mm)
    edges = np.cumsum(share / share.sum(axis=1, keepdims=True), axis=1)
    chosen = (rng.random((len(mean_mm), 1)) > edges[:, :-1]).sum(axis=1)
    scale = known.scale_mm[chosen]
    kept = np.zeros(len(mean_mm))
    kept[read] = scale[read] ** 2 / (scale[read] ** 2 + noise_mm[read] ** 2)
    spread = scale * np.sqrt(1.0 - kept)
    centre = np.where(read[:, None], mean_mm, 0.0) * kept[:, None]
    return centre + spread[:, None] * rng.normal(size=mean_mm.shape)


def forecast(
    state: State,
    simulations: int,
    wanted_mm: float | None = None,
    tolerance_mm: float | None = None,
    target: str = CANDIDATES,
    progress: Callable | None = None,
) -> Forecast | None:
    """Simulate the rest of the campaign; None where ``why_none`` says why.

    Where the assessor makes no statement on ``target``, its main one is taken.
    """
    if why_none(state):
        return None
    mean, noise = _by_row(state)
    read = np.isfinite(noise)
    known = population(mean[read], noise[read])
    left = state.plan.assessor.measurements - len(state.told)
    runs = []
    numbers = range(simulations)
    for number in progress(numbers, "simulated ends of the campaign") if progress else numbers:
        rng = np.random.default_rng([state.plan.seed, state.taken, number])
        errors = draw_errors(known, mean, noise, rng)
        entropy = (1, state.plan.seed, state.taken, number)
        runs.append(_one_end(state, errors, left, target, entropy))
    last = [run[-1][1] for run in runs]
    widths = quantiles(map(width_mm, last), (0.05, 0.5, 0.95))
    found = Forecast(simulations, left, tuple(widths), wanted_mm, target=last[0].target)
    if wanted_mm is not None:
        needed = [_first_within(run, wanted_mm) for run in runs]
        reached = float(np.mean([math.isfinite(each) for each in needed]))
        more = quantiles(needed, (0.5,))[0]
        found = replace(found, reached=reached, more=int(more) if math.isfinite(more) else None)
        if reached < ENOUGH:
            found = _larger(state, found, known, mean, noise, wanted_mm, simulations, progress)
    if tolerance_mm is not None:
        said = [decide(each, tolerance_mm).verdict for each in last]
        kinds = (ACCEPT, REJECT, UNDECIDED)
        found = replace(found, decisions={kind: said.count(kind) / len(said) for kind in kinds})
    return found


def why_none(state: State) -> Reason | None:
    """Why no forecast can be made; None where one can."""
    read = len({each.reading.point for each in (*state.told, *state.in_hand)})
    if read < FEWEST_POINTS:
        return Reason("few_read", {"read": read, "needed": FEWEST_POINTS})
    return None


def _larger(state, found: Forecast, known, mean, noise, wanted_mm, simulations, progress):
    """Look for a larger budget of a new campaign that does."""
    simulations = max(simulations // 2, 1)
    tried = None
    for factor in progress(_FACTORS, "larger budgets tried") if progress else _FACTORS:
        tried = math.ceil(factor * state.plan.assessor.measurements)
        assessor = replace(state.plan.assessor, measurements=tried)
        missed = 0
        for number in range(simulations):
            rng = np.random.default_rng([state.plan.seed, state.taken, number])
            errors = draw_errors(known, mean, noise, rng)
            entropy = (2, state.plan.seed, state.taken, number)
            campaign = assessor.begin(state.plan.candidates(state.rows))
            carry_on(campaign, noisy(errors, _root(state), tried, *entropy))
            missed += width_mm(_main(state.plan, campaign, found.target)) > wanted_mm
            if missed > (1.0 - ENOUGH) * simulations:
                break
        else:
            return replace(found, budget=tried, tried=tried)
    return replace(found, tried=tried)


def _one_end(
    state: State, errors_mm: np.ndarray, left: int, target: str, entropy: tuple[int, ...]
) -> list[tuple[int, Statement]]:
    """Statement on the target in one simulated end after some numbers of further readings."""
    campaign = copy.deepcopy(state.campaign)
    looks = [(0, _main(state.plan, campaign, target))]
    pause = max(left // _LOOKS, 1)

    def look(done: int) -> None:
        if done % pause == 0:
            looks.append((done, _main(state.plan, campaign, target)))

    done = carry_on(campaign, noisy(errors_mm, _root(state), left, *entropy), look)
    if looks[-1][0] != done:
        looks.append((done, _main(state.plan, campaign, target)))
    return looks


def _first_within(looks: Sequence[tuple[int, Statement]], wanted_mm: float) -> float:
    """Readings after which the bounds are first as near as wanted; infinite where never."""
    return next((done for done, said in looks if width_mm(said) <= wanted_mm), math.inf)


def _main(plan: Plan, campaign: Campaign, target: str) -> Statement:
    """The statement on a target; the first where there is none."""
    said = sayable(plan, campaign)
    return next((each for each in said if each.target == target), said[0])


def _by_row(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Mean readings (m, 3) and their noise (m,) by the assessor's rows; infinite where unread."""
    ledger = Ledger(state.plan.candidates(state.rows))
    row = {int(point): number for number, point in enumerate(state.rows)}
    for each in (*state.told, *state.in_hand):
        if each.reading.point in row:
            covariance = unplanned_mm2(state.plan, each.reading)
            ledger.record(row[each.reading.point], each.error_mm, covariance)
    return ledger.mean_mm, ledger.noise_mm


def _root(state: State) -> np.ndarray:
    """Roots (m, 3, 3) of the covariances of readings, by the assessor's rows."""
    return np.linalg.cholesky(state.plan.covariance_mm2[state.rows])


def _likelihood(square: np.ndarray, noise_mm: np.ndarray, scale_mm: np.ndarray) -> np.ndarray:
    """Density (n, w) of readings of squared size, each scaled to a peak of 1."""
    variance = scale_mm**2 + noise_mm[:, None] ** 2
    log = -1.5 * np.log(variance) - 0.5 * square[:, None] / variance
    return np.exp(log - log.max(axis=1, keepdims=True))


def in_words(found: Forecast) -> list[str]:
    """The forecast, line by line."""
    head = f"by {found.simulations} simulations from the readings so far"
    lines = []
    if found.left:
        low, middle, high = found.width_mm
        likely = f"{middle:.3f} mm apart" if math.isfinite(middle) else "not stated"
        top = f"{high:.3f} mm" if math.isfinite(high) else "none stated"
        spread = f" (90 % of cases: {low:.3f} mm to {top})" if math.isfinite(low) else ""
        lines.append(
            f"{head}: after the {found.left} readings left the bounds on "
            f"{words.TARGETS[found.target]} are likely {likely}{spread}"
        )
    if found.wanted_mm is not None:
        lines += _about_width(found, head)
    if found.decisions is not None and found.left:
        said = ", ".join(f"{kind} {share:.0%}" for kind, share in found.decisions.items())
        lines.append(f"likely decision at the end: {said}")
    return lines


def _about_width(found: Forecast, head: str) -> list[str]:
    wanted = f"{found.wanted_mm:g} mm apart"
    if found.more == 0:
        return [f"the bounds are as near as wanted ({wanted})"]
    lines = []
    if found.more is not None and found.left:
        lines.append(
            f"{wanted} after about {found.more} more readings; reached within the budget in "
            f"{found.reached:.0%} of cases"
        )
    elif found.left:
        lines.append(f"{wanted} is reached within the budget in {found.reached:.0%} of cases")
    if found.budget is not None:
        lines.append(
            f"a new campaign of {found.budget} readings would come {wanted} in at least "
            f"{ENOUGH:.0%} of cases ({head})"
        )
    elif found.tried is not None:
        lines.append(
            f"of new campaigns of up to {found.tried} readings, too few would come {wanted}"
        )
    return lines
