"""How often `kinacc verify` fails an arm that did not change: python tools/verify_level.py [ARMS]

The physical synthetic arm (mh180) is measured at 2,000 poses; a calibration is fitted to 80 of them
drawn at random, held out in five shares, and held to samples of the others, as the command does
it: base kept, or moved elsewhere and fitted, or base and tool. Where the arm is to have changed, an
offset of a joint is added to the reported joints of the sample.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kinacc import synthetic
from kinacc.calibration import fitting
from kinacc.calibration.constraints import free_parameters
from kinacc.calibration.models import Fit
from kinacc.calibration.observations import Observations, from_columns
from kinacc.calibration.residuals import Errors, cross_validated, errors
from kinacc.calibration.tables import frames_columns
from kinacc.config.error_models import MEASURED, Comparison
from kinacc.config.schema import defaults
from kinacc.deployment import verify
from kinacc.deployment.permutation import LEVEL, Columns, held_to
from kinacc.deployment.verify import BASE, TOOL
from kinacc.geometry import exp_so3
from kinacc.kinematics import robot
from kinacc.measurements import folds

POSES, FITTED, ARMS, SIZES = 2000, 80, 150, (5, 8, 12)
SETUPS: tuple[tuple[str, ...], ...] = ((), (BASE,), (BASE, TOOL))
WEIGHT = 500.0
MODEL = Comparison(MEASURED, "dh").name


def everything(arm: robot.Robot) -> Observations:
    """All poses of the physical arm."""
    settings = defaults()["measurements"]["synthetic"] | {"poses": POSES}
    columns = synthetic.measure(arm, settings)
    return from_columns({"repeat": np.zeros(POSES), **columns, "fold": np.full(POSES, np.nan)}, arm)


def fitted(seen: Observations, arm: robot.Robot) -> tuple[Fit, Errors]:
    """A calibration, and its errors at poses held out."""
    free = free_parameters(arm.dh.joints)

    def fit(part: Observations, _fold: int = 0) -> dict[str, Fit]:
        found = fitting.fit(
            part, arm.dh, free=free, rotation_weight_mm_per_rad=WEIGHT, threshold=1e-3
        )
        return {"dh": Fit(found.model, found.frames)}

    own = fit(seen)
    return own["dh"], cross_validated(seen, fit, range(5), own)[0][MODEL]


def with_columns(fit: Fit, off: Errors, seen: Observations, moved: tuple[str, ...]) -> Columns:
    """Errors at what was ``seen``, where ``moved`` is fitted to samples of it."""
    return verify._columns(fit.model, seen, fit.frames.targets, moved, off.position_mm[:, None])


def probabilities(
    fit: Fit, held: Columns, rest: Observations, moved: tuple[str, ...], arm, rng, joint, offset
) -> Iterator[tuple[int, float]]:
    """Of samples of every size, elsewhere where they were moved."""
    for size in SIZES:
        few = rest.select(rng.permutation(len(rest))[:size])
        turn, shift = exp_so3(rng.normal(0.0, 0.5, 3)), rng.normal(0.0, 500.0, 3)
        if BASE in moved:
            few = replace(
                few,
                position_mm=few.position_mm @ turn.T + shift,
                rotation=np.full_like(few.rotation, np.nan),
            )
        offsets = np.zeros(few.joints)
        offsets[joint] = 1e-3 * offset
        few = replace(few, q_rad=few.q_rad + offsets)
        frames = fit.frames
        if moved:
            kept = {"frames": frames_columns({"dh": fit.frames}, ("tool",))}
            frames = verify.frames_at(kept, "dh", fit.model, few, arm, moved, WEIGHT)
        there = Fit(fit.model, frames)
        new = with_columns(there, errors({"dh": there}, few)[MODEL], few, moved)
        yield size, held_to(held, new).probability


def main(arms: int, joint: int = 0, offset: float = 0.0) -> None:
    """Print the share of samples that fail, by size and by what was moved."""
    arm = robot.load("mh180")
    seen, rng = everything(arm), np.random.default_rng(1)
    found: dict[tuple, list[float]] = {}
    for _ in range(arms):
        order = rng.permutation(POSES)
        own = seen.select(order[:FITTED])
        own = replace(own, fold=folds.assign(np.arange(FITTED), 5, 0))
        fit, off = fitted(own, arm)
        rest = seen.select(order[FITTED:])
        for moved in SETUPS:
            held = with_columns(fit, off, own, moved)
            for _ in range(3):
                told = probabilities(fit, held, rest, moved, arm, rng, joint, offset)
                for size, probability in told:
                    found.setdefault((moved, size), []).append(probability)
    print(f"{arms} calibrations of {FITTED} poses; share that fails at {100 * LEVEL:g} %")
    for (moved, size), told in found.items():
        share = 100.0 * np.mean(np.array(told) <= LEVEL)
        what = " and ".join(moved) or "nothing"
        print(f"{what} moved, {size} poses: {share:.2f} % of {len(told)}")
    every = np.concatenate([*found.values()])
    print(f"all: {100.0 * np.mean(every <= LEVEL):.2f} % of {len(every)}")


if __name__ == "__main__":
    given = [float(each) for each in sys.argv[1:]]
    main(int(given[0]) if given else ARMS, *((int(given[1]) - 1, given[2]) if given[2:] else ()))
