"""Fig. 3 under its readings: the arms of each, what they are chosen by, and what is counted."""

from __future__ import annotations

import pandas as pd
import pytest
from shared_data import ROOT

from kinacc.config.schema import defaults
from kinacc.study import robustness
from kinacc.synthetic import accepted
from research.map_readings import READINGS, SENTENCES, judged_arms

CHOICE = ROOT / "research" / "data" / "map_choice.csv"


@pytest.fixture(scope="module")
def config() -> dict:
    config = {"robot": "mh180", **defaults()}
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
