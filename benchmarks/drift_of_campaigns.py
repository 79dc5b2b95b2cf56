"""What a drift does to campaigns: how often it is found, and how often bounds hold.

python benchmarks/drift_of_campaigns.py [CAMPAIGNS]

200 candidates, 320 readings, noise 0.1 mm. The frame drifts evenly, in a random direction, by so
many standard deviations from the first reading to the last.
"""

import sys

import numpy as np

from kinacc.assess.adaptive import Candidates
from kinacc.assess.random_numbers import key_of
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.simulate import carry_on
from kinacc.assess.world import drawn_world

POINTS, READINGS, NOISE_MM = 200, 320, 0.1


def campaign(drift: float, references: int, seed: int):
    """Upper and lower bound (NaN where withheld) and the truth, mm, of one campaign."""
    draw = np.random.default_rng((seed, 7))
    error_mm = draw.normal(0.0, 0.2, (POINTS, 3))
    direction = draw.normal(size=3)
    far_mm = drift * NOISE_MM * direction / np.linalg.norm(direction)
    world = drawn_world(error_mm, NOISE_MM, key_of(seed, 11), READINGS)
    begun = SearchAndConfirm(READINGS, references=references).begin(
        Candidates.with_equal_noise(world.sigma_mm)
    )
    taken = 0

    def reading_mm(row: int, visit: int) -> np.ndarray:
        nonlocal taken
        taken += 1
        return world.reading_mm(row, visit) + far_mm * (taken - 1) / (READINGS - 1)

    carry_on(begun, reading_mm)
    said = begun.statements()[0]
    return said.upper_mm, said.lower_mm, float(np.linalg.norm(error_mm, axis=1).max())


def main(campaigns: int) -> None:
    """Print a row for each drift and number of reference readings."""
    print("drift (sd)  references  withheld  upper holds  lower holds  width (mm)")
    for drift in (0.0, 1.0, 2.0, 3.0):
        for references in (0, 20):
            found = np.array([campaign(drift, references, seed) for seed in range(campaigns)])
            stated = found[np.isfinite(found[:, 0])]
            upper, lower, truth = stated.T
            held = (upper >= truth).mean(), (lower <= truth).mean(), (upper - lower).mean()
            withheld = 1.0 - len(stated) / campaigns
            print(f"{drift:10g}  {references:10d}  {withheld:8.3f}  {held[0]:11.3f}  "
                  f"{held[1]:11.3f}  {held[2]:10.3f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
