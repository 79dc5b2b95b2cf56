"""Further draws through fits, study and claims: the same answers as the workflow's own stages."""

from __future__ import annotations

import copy
import warnings

import numpy as np
import pandas as pd
import pytest

from kinacc.config.schema import defaults
from kinacc.errors import InputError
from kinacc.study import in_memory, robustness
from kinacc.study.claims.evaluate import evaluate, table_of


@pytest.fixture(scope="module")
def config() -> dict:
    config = {"robot": "mh180", **defaults()}
    config["map"]["grid_mm"] = 300.0
    config["study"]["repetitions"] = 3
    config["evaluation"]["points"] = 60
    config["study"]["measurements"] = 60
    config["robustness"]["draws"] = 3
    return config


@pytest.fixture(scope="module")
def rows(config):
    return robustness.run({}, config)["robustness_chunk"]


def test_a_draw_gets_the_verdicts_it_would_get_as_the_data_set(config, rows):
    own = copy.deepcopy(config)
    own["measurements"]["synthetic"]["draw"] = 2
    stages = ("measurements", *robustness.STAGES)
    whole = evaluate(in_memory.run(stages, own, {}), paper_arm=True)
    ours = rows["draw"] == 2
    assert rows["verdict"][ours].tolist() == whole["verdict"].tolist()
    assert np.array_equal(rows["reproduced"][ours], whole["reproduced"], equal_nan=True)


def test_parts_make_the_same_table(config, rows):
    parts = [{"number": number, "of": 5} for number in range(1, 6)]  # more than there are draws
    chunks = [robustness.run({}, {**config, "part": part})["robustness_chunk"] for part in parts]
    joined = {name: np.concatenate([chunk[name] for chunk in chunks]) for name in rows}
    whole, again = (
        pd.DataFrame(robustness.gathered({"robustness_chunk": chunk}, {})["robustness"])
        for chunk in (rows, joined)
    )
    pd.testing.assert_frame_equal(again, whole, check_exact=True)


def test_more_draws_than_were_accepted_is_refused(config):
    with pytest.raises(InputError, match=r"robustness\.draws"):
        robustness.run({}, {**config, "robustness": {"draws": 5000}})


def test_claims_on_other_settings_than_the_papers_say_so():
    settings = {"robot": "mh180", **defaults()}
    with warnings.catch_warnings(action="error"):
        table_of({}, settings)
    settings["study"]["alpha"] = 0.5
    with pytest.warns(UserWarning, match="other settings: study.alpha 0.5 here"):
        table_of({}, settings)
