"""What bounds of a campaign are worth on made-up errors: whether they hold, and how near they come.

python tools/bounds_worth.py SETUP WORLD READINGS CAMPAIGNS [FIELD ..], such as `plain stated 300
2000`: the campaigns of size `workshop` of the tournament (docs/tournament.md), 200 candidates,
noise 0.1 mm, more of them and a row for every field. The excess of upper bounds is over what is
attained with sizes known, the distance of lower ones over z sigma / sqrt(R + 1).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.special import bdtr, ndtri

from kinacc.assess.registry import RECOMMENDED
from kinacc.assess.statement import CANDIDATES
from kinacc.config.schema import defaults
from kinacc.study.tournament import contest
from kinacc.study.tournament.made_up_fields import MADE_UP, made_up
from kinacc.study.tournament.summary import FAMILY_ERROR, holm

POINTS, NOISE_MM, SEED, CORES = 200, 0.1, 17, 2
HEAD = (
    f"{'field':8} {'stated':>7} {'alarmed':>7} {'upper':>6} {'begun':>6} {'lower':>6} {'begun':>6} "
    f"{'excess':>7} {'over':>5} {'below':>7} {'over':>5} {'rmse':>7}"
)


def cell(name: str, setup: str, world: str, readings: int, campaigns: int) -> dict[str, float]:
    """Summary of the campaigns on one field."""
    own = next(each for each in contest.SETUPS if each.name == setup)
    size = replace(
        contest.SIZES["workshop"],
        budgets={POINTS: (readings,)},
        repetitions=campaigns,
        setups=(replace(own, worlds=(world,)),),
    )
    asked = contest.Contest(size, SEED, (RECOMMENDED,), defaults()["study"])
    found = contest.summed(contest.jobs([made_up(name)], size), asked)
    row = int(np.flatnonzero(found["target"] == CANDIDATES)[0])
    return {column: values[row] for column, values in found.items()}


def told(name: str, of: dict[str, float], readings: int) -> str:
    """The row of a field; of bounds stated, and of all campaigns begun, the share that hold."""
    begun, yardstick = of["repetitions"], math.nan
    if readings >= POINTS:
        z = -float(ndtri(1.0 - of["confidence"]))
        yardstick = z * NOISE_MM / math.sqrt(readings - POINTS + 1)
    below = of["width_mm"] - of["excess_mm"] if not of["excepted"] else math.nan
    wrong = [of["stated"] * (1.0 - of[f"{side}_holds"]) for side in ("upper", "lower")]
    return (
        f"{name:8} {of['stated'] / begun:7.2%} {of['alarmed'] / begun:7.2%} "
        f"{of['upper_holds']:6.3f} {1 - np.nan_to_num(wrong[0]) / begun:6.3f} "
        f"{of['lower_holds']:6.3f} {1 - np.nan_to_num(wrong[1]) / begun:6.3f} "
        f"{of['excess_mm']:7.4f} {of['excess_mm'] / of['attainable_mm']:5.2f} "
        f"{below:7.4f} {below / yardstick:5.2f} {of['rmse_mm']:7.4f}"
    )


def rejected(rows: Sequence[dict[str, float]], side: str) -> int:
    """Fields whose bounds on one side hold significantly less often than stated (Holm)."""
    some = [each for each in rows if each["stated"] > 0]
    held = np.array([round(each["stated"] * each[f"{side}_holds"]) for each in some])
    tried = np.array([each["stated"] for each in some])
    sure = np.array([each["confidence"] for each in some])
    return int(holm(bdtr(held, tried, sure), FAMILY_ERROR).sum())


def main(setup: str, world: str, readings: int, campaigns: int, names: Sequence[str]) -> None:
    print(f"{setup}, {world}: {readings} readings of {POINTS} candidates, {campaigns} campaigns")
    print(HEAD)
    of_field = partial(cell, setup=setup, world=world, readings=readings, campaigns=campaigns)
    rows = []
    with ProcessPoolExecutor(CORES) as pool:
        for name, found in zip(names, pool.map(of_field, names), strict=True):
            rows.append(found)
            print(told(name, found, readings), flush=True)
    print(f"rejected by Holm: {rejected(rows, 'upper')} upper, {rejected(rows, 'lower')} lower")


if __name__ == "__main__":
    setup, world, readings, campaigns, *names = sys.argv[1:]
    main(setup, world, int(readings), int(campaigns), names or list(MADE_UP))
