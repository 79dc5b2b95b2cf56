"""The claims over every choice the paper leaves open: the same answers as the study itself."""

from __future__ import annotations

import copy
from collections import Counter

import numpy as np
import pytest

from kinacc.config.schema import defaults
from kinacc.study import in_memory, robustness
from kinacc.study.claims.evaluate import all_claims, evaluate
from research import design
from research.dotted import value_at
from research.judged_runs import alike, judged
from research.open_choices import ALL, FIG_5, OPEN, STATED

# A choice of the fits, one that fits and space depend on, one of the study.
NAMES = ["vec_order", "reference_frame", "search"]


@pytest.fixture(scope="module")
def config() -> dict:
    config = {"robot": "mh180", **copy.deepcopy(defaults())}
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


def test_every_open_choice_has_keys_of_the_configuration_and_its_default_among_its_values():
    known = {"robot": "mh180", **defaults()}
    for choice in (*OPEN, *STATED):
        assert choice.word(known) is not None, choice.name
        for values in choice.values.values():
            assert len(values) == len(choice.keys)


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


def test_a_run_whose_space_is_out_of_reach_says_so_and_the_others_go_on(config):
    away = copy.deepcopy(config)
    away["evaluation"]["cylinder"]["inner_radius_mm"] = 4000.0
    away["choices"] = {"names": ["inner_radius"], "runs": 1}
    found, _ = judged(alike(design.runs(away), away), away)
    at_fault = (found["run"] == 0) & (found["claim"] == "maximum_overestimates")
    assert found["verdict"][at_fault].tolist() == ["not comparable"]
    assert "evaluation" in found["why"][at_fault].iloc[0]
    good = (found["choice"] == "inner_radius") & (found["claim"] == "maximum_overestimates")
    assert "not comparable" not in found["verdict"][good].tolist()


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


def test_a_choice_that_does_not_touch_a_stage_does_not_make_it_again(config, monkeypatch):
    made: Counter[str] = Counter()
    for name, stage in in_memory.RUNS.items():

        def counted(*given, name=name, stage=stage, **more):
            made[name] += 1
            return stage(*given, **more)

        monkeypatch.setitem(in_memory.RUNS, name, counted)
    alone = [run for run in design.runs(config) if run.varied in ("default", "search", "vec_order")]
    judged(alike(alone, config), config)
    assert len(alone) == 1 + 2 + 3
    assert (made["measurements"], made["vec"], made["accuracy_map"]) == (1, 4, 4)
    assert made["study"] == len(alone)
