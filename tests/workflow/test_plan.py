"""What a stage is told: enough for its result, and nothing whose change would rerun it in vain."""

import numpy as np
import pytest

from kinacc.config.schema import defaults
from kinacc.errors import InputError
from kinacc.workflow.catalogue import STAGES, maker_of
from kinacc.workflow.plan import Plan, planned
from kinacc.workflow.stages import histories, study, study_chunk

OVER_ALL = {"robustness_chunk"}  # goes through the whole study
CONFIG = "datasets: {arm: {robot: mh180}}\n"


@pytest.fixture
def plan_of(tmp_path):
    """The plan for the defaults and some further YAML."""

    def plan(text: str = "") -> Plan:
        (tmp_path / "a.yaml").write_text(CONFIG)
        (tmp_path / "b.yaml").write_text(text or "{}")
        return planned([tmp_path / "a.yaml", tmp_path / "b.yaml"])

    return plan


@pytest.fixture
def points():
    error_mm = np.random.default_rng(5).normal(0.0, 0.3, (15, 3))
    columns = {f"e{axis}_mm": error_mm[:, i] for i, axis in enumerate("xyz")}
    return {
        "point": np.arange(15),
        **columns,
        "true_error_mm": np.linalg.norm(error_mm, axis=1),
    }


ODD = """
study: {noise_mm: [0.07, 0.2], repetitions: 3, measurements: 25, alpha: 0.4, outlier_rule: iqr,
  distance: as_printed, covariance: sqrt_r, search: from_below, visiting_order: shuffled}
histories: {simulations_searched: 5, noise_mm: 0.2}
seed: 11
"""


def test_every_setting_a_stage_names_is_in_the_configuration():
    known = defaults() | {"dataset": "", "robot": "", "series": []}
    for stage in STAGES.values():
        for path in (*stage.settings, *stage.files):
            section = known
            for key in path.split("."):
                assert key in section, f"{stage.name}: {path}"
                section = section[key]


def test_every_input_is_made_by_an_earlier_stage():
    made = set()
    for stage in STAGES.values():
        assert set(stage.inputs) <= made
        made |= set(stage.outputs)
    assert all(maker_of(name).name in STAGES for name in made)


def test_the_study_stages_give_the_same_from_their_settings_as_from_all(plan_of, points):
    plan = plan_of(ODD)
    full = plan.datasets["arm"]
    tables = {"assessment_points": points}
    chunk = study_chunk.run(tables, plan.settings("study_chunk", "arm"))
    assert_same(chunk, study_chunk.run(tables, full))
    tables |= chunk
    assert_same(study.run(tables, plan.settings("study", "arm")), study.run(tables, full))
    assert_same(
        histories.run(tables, plan.settings("histories", "arm")), histories.run(tables, full)
    )


def assert_same(some, others):
    assert some.keys() == others.keys()
    for name, columns in some.items():
        for column, values in columns.items():
            np.testing.assert_array_equal(values, others[name][column], f"{name}.{column}")


@pytest.mark.parametrize(
    ("change", "stages"),
    [
        ("study: {search: bisection}", {"study", *OVER_ALL}),
        ("study: {repetitions: 7}", {"study_chunk", *OVER_ALL}),
        ("evaluation: {points: 7}", {"assessment_points", *OVER_ALL}),
        (
            "evaluation: {reference_frame: base}",
            {"measurements", "accuracy_map", "assessment_points", *OVER_ALL},
        ),
        ("map: {grid_mm: 50}", {"accuracy_map", *OVER_ALL}),
        ("robustness: {draws: 3}", OVER_ALL),
        ("measurements: {file: {decimal: ','}}", set()),
        ("measurements: {synthetic: {poses: 700}}", {"measurements", *OVER_ALL}),
        ("figures: {formats: [svg]}", set()),
        ("study: {chunks: 5}", set()),
    ],
)
def test_a_value_is_told_to_the_stages_that_depend_on_it(plan_of, change, stages):
    before, after = plan_of(), plan_of(change)
    told = {
        name
        for name in before.stages("arm")
        if before.settings(name, "arm") != after.settings(name, "arm")
    }
    assert told == stages


def test_no_more_parts_than_repetitions_or_draws(plan_of):
    plan = plan_of("study: {chunks: 9, repetitions: 2}\nrobustness: {draws: 1}")
    assert plan.part_names("study_chunk", "arm") == ["1-of-2", "2-of-2"]
    assert plan.part_names("robustness_chunk", "arm") == ["1-of-1"]
    assert plan.part_names("study", "arm") == [None]


def test_joints_in_a_file_of_their_own_are_an_input_and_a_setting(plan_of, tmp_path):
    for name in ("points.csv", "joints.csv"):
        (tmp_path / name).touch()
    text = """
datasets:
  two:
    robot: mh180
    evaluation: {{space: measured}}
    measurements:
      source: file
      file: {{path: "{folder}/points.csv", orientation: {{kind: none}}{joints}}}
"""
    beside = f', joints: {{path: "{tmp_path}/joints.csv", by: order}}'
    plan = plan_of(text.format(folder=tmp_path, joints=beside))
    assert plan.inputs("measurements", "two")["joints_file"] == f"{tmp_path}/joints.csv"
    assert plan.settings("measurements", "two")["measurements"]["file"]["joints"]["by"] == "order"
    alone = plan_of(text.format(folder=tmp_path, joints=""))
    file = alone.settings("measurements", "two")["measurements"]["file"]
    assert not {"joints", "pulses_per_deg", "repeats_in_names"} & set(file)


def test_other_picture_formats_for_one_data_set_are_refused(plan_of):
    with pytest.raises(InputError, match=r"datasets\.two\.figures\.formats"):
        plan_of("datasets: {two: {robot: mh180, figures: {formats: [png]}}}")


def test_robustness_counts_for_the_claims_once_it_is_asked_for_or_there(plan_of, tmp_path):
    plan = Plan(plan_of().datasets, {"arm": 2}, ("svg",), str(tmp_path))
    assert "robustness" not in plan.inputs("claims", "arm")
    table = tmp_path / "arm" / "robustness.parquet"
    assert str(table) not in plan.targets("arm")
    asked = plan.targets("arm", also=["robustness_table"])
    assert {str(table), str(tmp_path / "arm" / "claims.parquet")} <= set(asked)
    assert plan.inputs("claims", "arm", on_request=True)["robustness"] == str(table)
    table.parent.mkdir()
    table.touch()
    assert plan.inputs("claims", "arm")["robustness"] == str(table)


def test_numbers_given_inside_a_mapping_on_the_command_line_are_numbers(tmp_path):
    (tmp_path / "a.yaml").write_text(CONFIG)
    plan = planned([tmp_path / "a.yaml"], {"study": {"alpha": "0.5"}})
    assert plan.datasets["arm"]["study"]["alpha"] == 0.5
