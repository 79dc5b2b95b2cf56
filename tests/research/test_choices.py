"""The claims over every choice the paper leaves open: the same answers as the study itself."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.config.schema import defaults
from kinacc.study import in_memory, robustness
from kinacc.study.claims.evaluate import all_claims, evaluate
from research import design
from research.dotted import value_at
from research.judged_runs import alike, judged
from research.open_choices import ALL, FIG_5, OPEN

# A choice of the fits, one that fits and space depend on, one of the study.
NAMES = ["vec_order", "reference_frame", "search"]


@pytest.fixture(scope="module")
def config() -> dict:
    config = {"robot": "mh180", **defaults()}
    config["map"]["grid_mm"] = 300.0
    config["study"] |= {"repetitions": 3, "measurements": 40}
    config["evaluation"]["points"] = 40
    config["histories"]["simulations_searched"] = 20
    config["robustness"]["draws"] = 2
    config["choices"] = {"runs": 2, "names": NAMES}
    return config


@pytest.fixture(scope="module")
def found(config):
    return judged(alike(design.runs(config), config), config)[0].sort_values("run", kind="stable")


def test_every_value_alone_every_arm_and_all_at_once(found):
    wanted = [claim.id for claim in all_claims()]
    for varied, runs in {"default": 1, "arm": 2, "search": 2, "all": 2, "all_and_arm": 2}.items():
        mine = found["choice"] == varied
        assert found["claim"][mine].tolist() == wanted * runs
    followed = found["claim"][found["choice"] == FIG_5]
    assert followed.tolist() == [name for name in wanted if name.startswith(("fig5", "fig6"))] * 6


@pytest.mark.parametrize("varied", ["default", *NAMES, "arm", "all"])
def test_a_choice_gets_the_verdicts_it_would_get_as_the_data_set(config, found, varied):
    """What runs share is made once, and no run takes what another has made differently."""
    run = [each for each in design.runs(config) if each.varied == varied][-1]
    stages = ("measurements", *robustness.STAGES)
    whole = evaluate(in_memory.run(stages, run.configured(config), {}), paper_arm=True)
    ours = found["run"] == run.number
    assert found["verdict"][ours].tolist() == whole["verdict"].tolist()
    assert np.array_equal(found["statistic"][ours], whole["reproduced"], equal_nan=True)


def test_a_sample_varies_every_choice_at_once(config):
    many = {**config, "choices": {"names": [], "runs": 64}}
    sample = [run for run in design.runs(many) if run.varied == ALL]
    for choice in OPEN:
        words = [run.chosen[choice.name] for run in sample]
        counts = [words.count(word) for word in choice.values]
        assert min(counts) >= 0.5 * len(sample) / len(choice.values)
    for run in sample:
        configured = run.configured(many)
        for choice in OPEN:
            values = tuple(value_at(configured, key) for key in choice.keys)
            assert values == choice.values[run.chosen[choice.name]]
