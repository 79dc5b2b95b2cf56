"""The rule that chooses the reading of Fig. 3, on made-up sentences."""

from __future__ import annotations

import pandas as pd
import pytest

from research.map_readings import READINGS, SENTENCES, choice


def arms_of(number: int, held: list[int], reached: float = 1.0) -> pd.DataFrame:
    """An arm for each of ``held``, on which so many of the seven sentences hold."""
    reading = READINGS[number]
    return pd.DataFrame([
        {
            "reference_frame": reading.reference_frame,
            "reference_orientation": reading.orientation,
            "rotations": reading.rotations,
            "seed": seed, "reached": reached, "claim": claim,
            "verdict": "agrees" if place < count else "differs",
        }
        for seed, count in enumerate(held)
        for place, claim in enumerate(SENTENCES)
    ])  # fmt: skip


@pytest.mark.parametrize(
    ("tables", "chosen"),
    [
        # 3.5 against 2.5 sentences, standard errors 0.29: the better one
        ([arms_of(12, [2, 2, 3, 3]), arms_of(13, [3, 3, 4, 4])], 1),
        # 2.75 against 3.0: within the standard error of the difference, so the one with nine turns
        ([arms_of(12, [2, 3, 3, 3]), arms_of(13, [2, 3, 3, 4])], 0),
        # the best reaches half of its combinations only
        ([arms_of(12, [2, 2, 3, 3]), arms_of(13, [6, 6, 7, 7], reached=0.5)], 0),
        # one angle is simpler than two, whatever the turns
        ([arms_of(13, [3, 3, 4, 4]), arms_of(18, [3, 3, 4, 4])], 0),
    ],
)
def test_the_reading_with_most_sentences_is_chosen_and_ties_go_to_the_simpler(tables, chosen):
    found = choice(pd.concat(tables, ignore_index=True))
    assert found["chosen"].tolist() == [number == chosen for number in range(len(tables))]
