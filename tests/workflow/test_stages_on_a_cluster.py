"""Who has a study computed on a cluster: which stages share a job there, and what they ask for."""

from __future__ import annotations

import graphlib

import pytest

from kinacc.workflow import cluster
from kinacc.workflow.catalogue import STAGES, maker_of
from kinacc.workflow.plan import planned

LONG = "{repetitions: 10000, chunks: 8}"


def plan_of(**sections):
    return planned(["config.yaml"], sections)


def groups(plan, dataset="mh180"):
    """Stage -> its group; where it has a job of its own, its name."""
    return {name: cluster.group(plan, name, dataset) or name for name in plan.stages(dataset)}


def test_the_papers_study_is_one_job_and_one_for_the_example():
    found = groups(plan_of())
    plain = {name: group for name, group in found.items() if not STAGES[name].on_request}
    assert plain.pop("fig1") == "examples"
    assert set(plain.values()) == {"calibration"}


def test_a_study_of_hours_has_a_job_for_every_part():
    found = groups(plan_of(study=LONG))
    assert found["study_chunk"] == "study_chunk"
    later = {name for name, group in found.items() if group == "assessment"}
    assert later == {"study", "fig4", "claims", "report"}


@pytest.mark.parametrize("study", ["{}", LONG])
@pytest.mark.parametrize("choices", ["{}", "{runs: 1}"])
def test_no_job_waits_for_itself(study, choices):
    plan = plan_of(study=study, choices=choices, robustness="{draws: 1}")
    found = groups(plan)
    before: dict[str, set[str]] = {}
    for name, group in found.items():
        makers = {maker_of(each).name for each in (*STAGES[name].inputs, *STAGES[name].optional)}
        needed = {found[maker] for maker in makers if maker in found}
        before.setdefault(group, set()).update(needed - {group})
    graphlib.TopologicalSorter(before).prepare()


def test_tables_made_on_request_are_there_when_the_job_that_reads_them_starts():
    found = groups(plan_of(robustness="{draws: 1}"))
    assert found["robustness_table"] != found["claims"]


def test_limits_grow_with_the_work_fall_with_the_parts_and_double_after_a_failure():
    def minutes(study, attempt=1):
        return cluster.runtime_min(plan_of(study=study), "study_chunk", "mh180", attempt)

    assert minutes("{repetitions: 100}") == 1
    assert minutes("{repetitions: 10000, chunks: 1}") > 5 * minutes(LONG) > 5
    assert minutes(LONG, attempt=2) == 2 * minutes(LONG)
    assert cluster.memory_mb("vec", attempt=2) == 2 * cluster.memory_mb("vec") >= 2000
