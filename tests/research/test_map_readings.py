"""Fig. 3 under its readings: the arms of each, what they are chosen by, and what is counted."""

from __future__ import annotations

import copy
from pathlib import Path

import pandas as pd
import pytest

from kinacc.config.schema import defaults
from kinacc.study import robustness
from kinacc.synthetic import accepted
from research.map_readings import READINGS, SENTENCES, judged_arms, shares

CHOICE = Path(__file__).parents[2] / "research" / "data" / "map_choice.csv"


@pytest.fixture(scope="module")
def config() -> dict:
    config = {"robot": "mh180", **copy.deepcopy(defaults())}
    config["map"]["grid_mm"] = 300.0
    return config


def test_the_reading_of_the_configuration_has_the_shipped_arm_and_its_verdicts(config):
    (reading,) = [each for each in READINGS if each.of(config) == config]
    as_shipped = pd.DataFrame(judged_arms(reading, config, 1, 30))
    assert as_shipped["seed"].unique().tolist() == [int(accepted.rows()[0]["seed"])]
    whole = robustness.claims_on(0, config)
    verdicts = dict(zip(whole["claim"], whole["verdict"], strict=True))
    found = dict(zip(as_shipped["claim"], as_shipped["verdict"], strict=True))
    assert found == {name: verdicts[name] for name in SENTENCES}
    chosen = pd.read_csv(CHOICE).query("chosen").iloc[0]
    assert chosen["rotations"] == reading.rotations
    assert chosen["reference_orientation"] == reading.orientation
    assert chosen["reference_frame"] == reading.reference_frame


def some_arms() -> pd.DataFrame:
    """Two arms of every reading, from the last to the first; on one arm every sentence holds."""
    rows = [
        (each.reference_frame, each.orientation, each.rotations, seed, 0.5, name, 1.0, verdict)
        for each in reversed(READINGS)
        for seed, verdict in ((3, "agrees"), (7, "differs"))
        for name in SENTENCES
    ]
    names = ["reference_frame", "reference_orientation", "rotations", "seed", "reached", "claim"]
    return pd.DataFrame(rows, columns=[*names, "reproduced", "verdict"])


def test_shares_are_counted_over_the_arms_where_a_sentence_can_be_judged():
    table = some_arms()
    found = shares(table)
    assert (found.arms == 2).all()
    assert (found.holds == 0.5).all()
    assert (found.sentences == len(SENTENCES) / 2).all()
    assert (found.reached == 0.5).all()
    unjudged = (table["claim"] == SENTENCES[0]) & (table["seed"] == 7)
    table.loc[unjudged, "verdict"] = "not comparable"
    assert (shares(table).holds[:, 0] == 1.0).all()
