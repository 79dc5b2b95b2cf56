"""Fig. 3 under its readings: the arms of each, what they are chosen by, and what is counted."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from kinacc.artifacts import store
from kinacc.artifacts.contract import ARTEFACTS
from kinacc.artifacts.store import to_table
from kinacc.config.schema import defaults
from kinacc.errors import InputError
from kinacc.figures import fig3_readings
from kinacc.study.map_readings import READINGS, SENTENCES, shares
from kinacc.synthetic import accepted
from kinacc.workflow import arm_search, in_memory
from kinacc.workflow.stages import map_readings, map_readings_chunk, robustness_chunk
from kinacc.workflow.verification.conformity import check_file

PROVENANCE = {
    **dict.fromkeys(("kinacc_version", "config_hash", "code_hash", "inputs_hash"), "0"),
    "seed": 1,
}


@pytest.fixture(scope="module")
def config() -> dict:
    config = {"robot": "mh180", **copy.deepcopy(defaults())}
    config["map"]["grid_mm"] = 300.0
    config["map_readings"] = {"arms": 1, "seeds": 30}
    return config


def part_of(config: dict, number: int) -> dict[str, np.ndarray]:
    part = {"number": number, "of": len(READINGS)}
    return map_readings_chunk.run({}, {**config, "part": part})["map_readings_chunk"]


@pytest.fixture(scope="module")
def as_shipped(config):
    return part_of(config, 1)


def test_the_reading_of_the_configuration_has_the_shipped_arm_and_its_verdicts(config, as_shipped):
    assert READINGS[0].of(config) == config
    assert np.unique(as_shipped["seed"]).tolist() == [int(accepted.rows()[0]["seed"])]
    whole = robustness_chunk.claims_on(0, config)
    verdicts = dict(zip(whole["claim"], whole["verdict"], strict=True))
    found = dict(zip(as_shipped["claim"], as_shipped["verdict"], strict=True))
    assert found == {name: verdicts[name] for name in SENTENCES}
    assert (as_shipped["reached"] == 1.0).all()


def test_another_reading_has_arms_that_meet_the_paper_under_its_own_plan(config):
    number = next(i for i, each in enumerate(READINGS) if each.reference_frame == "base")
    rows = part_of(config, number + 1)
    to_table("map_readings_chunk", rows, PROVENANCE)
    (seed,) = np.unique(rows["seed"])
    own = READINGS[number].of(config)
    bench = arm_search.bench_of(own)
    again = arm_search.trial(bench, int(seed))
    assert again.accepted
    assert not any(arm_search.trial(bench, earlier).accepted for earlier in range(int(seed)))
    seen = arm_search.measured(bench, again.draw)
    shipped = in_memory.run(("measurements",), config, {})["measurements"]
    assert not np.allclose(seen["q6"], shipped["q6"])


def test_a_reading_for_which_no_arm_is_found_has_no_rows_and_no_share(config, tmp_path):
    none = part_of({**config, "map_readings": {"arms": 1, "seeds": 2}}, 1)
    assert none["claim"].size == 0
    path = tmp_path / "1-of-20.parquet"
    store.write(path, "map_readings_chunk", none, PROVENANCE)
    assert not check_file(path, ARTEFACTS["map_readings_chunk"])[1]
    found = shares(map_readings.run({"map_readings_chunk": none}, {})["map_readings"])
    assert found.arms.tolist() == [0] * len(READINGS)
    assert np.isnan(found.holds).all()
    with pytest.raises(InputError, match="no row"):
        fig3_readings.draw(none)


def some_arms() -> dict[str, np.ndarray]:
    """Two arms of every reading, from the last to the first; on one arm every sentence holds."""
    rows = [
        (each.reference_frame, each.orientation, each.rotations, seed, 0.5, name, 1.0, verdict)
        for each in reversed(READINGS)
        for seed, verdict in ((3, "agrees"), (7, "differs"))
        for name in SENTENCES
    ]
    names = ("reference_frame", "reference_orientation", "rotations", "seed", "reached", "claim")
    columns = zip(*rows, strict=True)
    return {
        name: np.array(column, dtype=object if isinstance(column[0], str) else None)
        for name, column in zip((*names, "reproduced", "verdict"), columns, strict=True)
    }


def test_shares_are_counted_over_the_arms_where_a_sentence_can_be_judged():
    table = map_readings.run({"map_readings_chunk": some_arms()}, {})["map_readings"]
    assert table["reference_frame"][0] == READINGS[0].reference_frame
    found = shares(table)
    assert (found.arms == 2).all()
    assert (found.holds == 0.5).all()
    assert (found.sentences == len(SENTENCES) / 2).all()
    assert (found.reached == 0.5).all()
    table["verdict"][(table["claim"] == SENTENCES[0]) & (table["seed"] == 7)] = "not comparable"
    assert (shares(table).holds[:, 0] == 1.0).all()


def test_the_picture_names_every_reading_and_writes_every_share():
    figure = fig3_readings.draw(some_arms(), dataset="mh180")
    words = [text.get_text() for text in figure.axes[0].texts]
    assert words.count("50 %") == len(READINGS) * (len(SENTENCES) + 1)
    assert sum("9 turns" in each for each in words) == len(READINGS) / 2


def test_an_arm_left_unmeasured_would_not_have_been_accepted(config):
    bench = arm_search.bench_of(config)
    # Of all shipped arms the one that is predicted to be farthest off.
    assert arm_search.trial(bench, 221).accepted
    left_out = [
        each.draw
        for each in (arm_search.trial(bench, seed) for seed in range(6))
        if not each.numbers
    ]
    assert left_out
    for draw in left_out:
        assert not arm_search.judged(bench, draw).accepted
