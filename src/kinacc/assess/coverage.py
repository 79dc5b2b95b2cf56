"""From the measured points to all candidates: who can have been missed, with what probability."""

from __future__ import annotations

from dataclasses import replace
from math import comb

from kinacc.assess.adaptive import Ledger
from kinacc.assess.statement import CANDIDATES, Reason, Statement


def about_all_if_all_measured(said: Statement, ledger: Ledger) -> tuple[Statement, ...]:
    """A statement on the measured points, and the same on all candidates where they are all."""
    if len(ledger.visited) == ledger.candidates.points:
        return said, replace(said, target=CANDIDATES)
    points = ledger.candidates.points
    withheld = Reason("unmeasured", {"left": points - len(ledger.visited), "points": points})
    return said, Statement(CANDIDATES, value_mm=said.value_mm, withheld=withheld)


def hardly_missed(points: int, error: float) -> int:
    """Smallest number of random points that hold the largest of ``points`` but for ``error``."""
    return next(seen for seen in range(points + 1) if points - seen <= error * points)


def excepted(points: int, seen: int, error: float) -> int:
    """Smallest K such that K + 1 points of ``points`` are all missed with ``error`` at most.

    ``seen`` of them are measured at random: C(points - K - 1, seen) / C(points, seen). All but K
    points are then no larger than the largest measured one, whatever their errors are.
    """
    return companions(points, seen, error) - 1


def companions(points: int, seen: int, error: float) -> int:
    """Smallest number of points of which at least one is among ``seen`` random ones of ``points``.

    But for probability ``error``; the draws are without replacement.
    """
    count = 1
    while at_most(0, count, points, seen) > error:
        count += 1
    return count


def at_most(found: int, marked: int, points: int, seen: int) -> float:
    """Probability that at most ``found`` of ``marked`` points are among ``seen`` of ``points``."""
    if found >= min(marked, seen):
        return 1.0
    ways = sum(comb(marked, k) * comb(points - marked, seen - k) for k in range(found + 1))
    return ways / comb(points, seen)
