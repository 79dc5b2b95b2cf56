"""The check of a results folder: silent on a good one, and every planted fault found and named."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command_line import call
from small_results import SmallResults

from kinacc.artifacts import provenance, store
from kinacc.artifacts.contract import METADATA_KEYS
from kinacc.artifacts.error_models import ALWAYS
from kinacc.workflow.catalogue import CALIBRATION, STAGES
from kinacc.workflow.plan import planned
from kinacc.workflow.verification import check, rules
from kinacc.workflow.verification.recomputation import Again

ROOT = Path(__file__).parents[2]
ON_EVERY_RUN = [
    name
    for stage in STAGES.values()
    if stage.leaves == "tables"
    and not (stage.scattered or stage.on_request or stage.measured or stage.of_lines)
    and stage.fits in ("", *ALWAYS)
    for name in stage.outputs
]


@pytest.fixture
def results(tmp_path, monkeypatch) -> SmallResults:
    monkeypatch.setattr(provenance, "stage_code_hash", lambda *_: "code")
    return SmallResults(tmp_path / "results")


def problems(results) -> list[str]:
    report = check.check_results(results.root)
    assert report.ok == (report.exit_code == 0)
    assert report.ok == (not any(each.problems for each in report.datasets))
    return [str(problem) for each in report.datasets for problem in each.problems]


def the_one(found: list[str], *words: str) -> None:
    matching = [text for text in found if all(word in text for word in words)]
    assert len(matching) == 1, f"{words} in {len(matching)} of {found}"


def rewrite(path, change) -> None:
    """Write a table's file again with another Arrow table, past the contract."""
    pq.write_table(change(pq.read_table(path)), path)


def put(results, artefact, column, row, value):
    """One table's column with one value changed."""
    values = list(results.tables[artefact][column])
    values[row] = value
    return {column: values}


def test_a_good_folder_has_no_problem(results):
    report = check.check_results(results.root)
    assert report.ok, str(report)
    (note,) = report.datasets[0].notes
    assert "not computed again without their settings (--config)" in note
    paths = [Path(path) for path in report.datasets[0].checked if path.endswith(".parquet")]
    tables = {path.stem for path in paths if path.parent == results.folder}
    assert tables == set(ON_EVERY_RUN)
    assert {path.parent.name for path in paths} == {"mh180", "study_chunk"}


def test_one_data_set_may_be_checked_by_its_own_folder(results):
    (folder,) = [path for path in results.root.iterdir() if path.is_dir()]
    report = check.check_results(folder)
    assert report.ok, str(report)
    assert [each.name for each in report.datasets] == [folder.name]
    (folder / "claims.parquet").unlink()
    assert not check.check_results(folder).ok


def test_the_report_is_readable_by_people_and_machines(results):
    (results.folder / "figures" / "fig4.png").unlink()
    done = call("check-results", results.root, "--json")
    assert done.exit_code == 1
    told = json.loads(done.stdout)
    assert told["ok"] is False
    assert told["datasets"][0]["name"] == "mh180"
    assert told["datasets"][0]["problems"][0]["where"].endswith("fig4.png")
    done = call("check-results", results.root)
    assert done.exit_code == 1
    assert "fig4.png: no such file" in done.stdout


def test_a_folder_that_is_none(tmp_path):
    assert "no such folder" in str(check.check_results(tmp_path / "absent"))
    assert "holds no data set" in str(check.check_results(tmp_path))
    assert not check.check_results(tmp_path).ok


@pytest.mark.parametrize("artefact", ON_EVERY_RUN)
def test_an_absent_table_is_named(results, artefact):
    results.path(artefact).unlink()
    the_one(problems(results), f"{artefact}.parquet: missing")


def test_a_map_may_be_left_out_where_the_claims_were_made_without_it(results):
    results.path("accuracy_map").unlink()
    results.save("claims")
    for kind in check.FORMATS:
        (results.folder / "figures" / f"fig3.{kind}").unlink()
    results.leave("report")
    report = check.check_results(results.root)
    assert report.ok, str(report)
    assert any("accuracy_map, fig3 left out" in note for note in report.datasets[0].notes)


def without_a_study(results) -> None:
    """Leave what `kinacc calibrate` leaves: the tables of the calibration and the page."""
    shutil.rmtree(results.folder / "figures")
    shutil.rmtree(results.folder / "study_chunk")
    for path in (results.folder / "records").iterdir():
        if path.stem not in (*CALIBRATION, "report"):
            path.unlink()
    results.leave("report")
    of_calibration = {name for stage in CALIBRATION for name in STAGES[stage].outputs}
    for path in results.folder.glob("*.parquet"):
        if path.stem not in of_calibration:
            path.unlink()


@pytest.mark.parametrize("page", [True, False], ids=["with its page", "models only"])
@pytest.mark.parametrize("configs", [(), ("--config", ROOT / "config.yaml")], ids=["", "config"])
def test_a_calibration_without_a_study_is_well_and_told_once(planned_results, configs, page):
    without_a_study(planned_results)
    if not page:
        (planned_results.folder / "report.html").unlink()
        (planned_results.folder / "records" / "report.json").unlink()
    done = call("check-results", planned_results.root, *configs)
    assert done.exit_code == 0, done.stdout
    assert "all is well" in done.stdout
    assert done.stdout.count("no study was made: kinacc study FILE.yaml makes one") == 1
    assert "fig1" not in done.stdout


def test_a_table_lost_from_a_calibration_without_a_study_is_the_one_problem(results):
    without_a_study(results)
    results.path("pose_errors").unlink()
    (found,) = problems(results)
    assert "pose_errors.parquet: missing" in found


@pytest.mark.parametrize(
    "left", ["figures/fig1.svg", "claims.parquet", "study_chunk/1-of-2.parquet"]
)
def test_a_study_of_which_one_file_is_left_lacks_all_the_others(results, left):
    kept = (results.folder / left).read_bytes()
    without_a_study(results)
    (results.folder / left).parent.mkdir(exist_ok=True)
    (results.folder / left).write_bytes(kept)
    the_one(problems(results), "study.parquet: missing")
    the_one(problems(results), "fig4.png: no such file")
    assert "no study was made" not in str(check.check_results(results.root))


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "is empty"), (b"GIF89a", "is not a png file"), (b"\x89PNG\r\n\x1a\n12", "is cut off")],
)
def test_a_picture_that_is_none(results, content, words):
    (results.folder / "figures" / "fig1.png").write_bytes(content)
    the_one(problems(results), "fig1.png", words)


def test_a_file_that_is_no_parquet(results):
    results.path("study").write_bytes(b"half a table")
    the_one(problems(results), "study.parquet", "not a readable Parquet file")


def test_a_missing_column(results):
    rewrite(results.path("claims"), lambda table: table.drop_columns(["share"]))
    the_one(problems(results), "claims.parquet, column share", "missing")


def test_an_unknown_column(results):
    rewrite(
        results.path("claims"),
        lambda table: table.append_column("mood", pa.array(["good"] * len(table))),
    )
    the_one(problems(results), "claims.parquet, column mood", "not in the contract")


def test_a_wrong_type(results):
    def change(table):
        index = table.schema.get_field_index("share")
        field = table.schema.field("share")
        return table.set_column(
            index,
            pa.field("share", pa.float32(), True, field.metadata),
            table["share"].cast("float32"),
        )

    rewrite(results.path("claims"), change)
    the_one(problems(results), "claims.parquet, column share", "float", "double")


@pytest.mark.parametrize(
    ("metadata", "words"),
    [
        ({b"unit": b"um"}, "unit is 'um'"),
        (None, "unit is nothing"),
    ],
)
def test_a_wrong_or_absent_unit(results, metadata, words):
    def change(table):
        index = table.schema.get_field_index("noise_mm")
        field = table.schema.field("noise_mm")
        kept = None if metadata is None else field.metadata | metadata
        schema = table.schema.set(index, field.with_metadata(kept))
        return table.cast(schema)

    rewrite(results.path("readings"), change)
    the_one(problems(results), "readings.parquet, column noise_mm", words)


@pytest.mark.parametrize("key", METADATA_KEYS)
def test_a_missing_provenance_key(results, key):
    def change(table):
        kept = {name: each for name, each in table.schema.metadata.items() if name != key.encode()}
        return table.replace_schema_metadata(kept)

    rewrite(results.path("claims"), change)
    the_one(problems(results), "claims.parquet", f"lacks {key}")


def test_provenance_with_more_than_its_keys(results):
    rewrite(
        results.path("claims"),
        lambda table: table.replace_schema_metadata(table.schema.metadata | {b"time": b"now"}),
    )
    the_one(problems(results), "claims.parquet", "schema metadata has 'time'")


LIMITS = [
    ("measurements", "measurements", "q2", 1, 100.0, "q2 beyond two turns"),
    ("measurements", "measurements", "s1", 1, 2, "column s1"),
    ("measurements", "measurements", "x_mm", 1, 1e9, "1e+09 mm in row 1"),
    ("vec", "vec_model", "error", 0, "delta_w", "'delta_w' in row 0"),
    ("residuals", "residuals", "mean", 0, -0.1, "-0.1 see unit in row 0"),
    ("study_chunk", "study_chunk", "noise_mm", 0, 300.0, "300 mm in row 0"),
    ("histories", "histories", "rejection_probability", 2, 1.5, "1.5 in row 2"),
    ("claims", "claims", "verdict", 0, "maybe", "'maybe' in row 0"),
    ("claims", "claims", "claim", 0, "a claim!", "'a claim!' in row 0"),
    ("claims", "claims", "statement", 0, " ", "column statement"),
    ("claims", "claims", "share", 0, 1.2, "1.2 in row 0"),
]


@pytest.mark.parametrize(("stage", "artefact", "column", "row", "value", "words"), LIMITS)
def test_values_out_of_their_limits(results, stage, artefact, column, row, value, words):
    results.change(stage, artefact, **put(results, artefact, column, row, value))
    found = problems(results)
    assert any(f"{artefact}" in text and words in text for text in found), found


@pytest.mark.parametrize("slides", [False, True])
def test_only_joints_that_slide_go_beyond_two_turns(slides):
    rows = "\n".join(
        "  - {joint: prismatic}" if slides and joint == 1 else "  - {}" for joint in range(1, 7)
    )
    tables = {
        "robot": {"description": np.array([f"dh:\n{rows}\n"], dtype=object)},
        "vec_model": {
            "joint": np.arange(1, 7),
            "q_min_rad": np.array([-3000.0, -1.0, -1.0, -1.0, -1.0, -1.0]),
            "q_max_rad": np.full(6, 1.0),
        },
    }
    rule = next(rule for needed, rule in rules.RULES if needed == ("vec_model", "robot"))
    found = [problem.what for problem in rule(tables)]
    assert found == ([] if slides else ["q_min_rad beyond two turns in row 0"])


def test_a_key_used_twice(results):
    results.change("claims", "claims", claim=["twice", "twice"])
    the_one(problems(results), "claims.parquet", "claim twice in rows 0, 1", "one row per claim")


def test_a_table_without_rows(results):
    rewrite(results.path("histories"), lambda table: table.slice(0, 0))
    the_one(problems(results), "histories.parquet", "has no rows")


RULES = [
    ("measurements", "measurements", "qw", 0, 0.9, "quaternion not of length 1 in row 0"),
    ("measurements", "measurements", "qx", 1, None, "quaternion null in part in row 1"),
    ("measurements", "measurements", "pose", 1, 0, "pose at other joints in row 1"),
    ("vec", "vec_model", "direction", 0, 1, "travel direction in row 0"),
    ("vec", "vec_model", "q_max_rad", 0, -2.0, "empty joint range in row 0"),
    ("vec", "vec_model", "d_mm", 1, 3.0, "another d_mm in row 1"),
    ("dh", "frames", "model", 2, "vec", "no base of model dh"),
    ("dh", "frames", "x_mm", 0, 3.0, "frame base of model vec differs"),
    ("dh", "dh_model", "joint", 5, 7, "joints 1, 2, 3, 4, 5, 7"),
    ("residuals", "pose_errors", "row", 6, 9, "no such row in row 6"),
    ("residuals", "pose_errors", "pose", 2, 1, "another pose in row 2"),
    ("residuals", "pose_errors", "target", 2, "A", "another target in row 2"),
    (
        "residuals",
        "pose_errors",
        "ex_mm",
        0,
        0.3,
        "residuals.parquet, row 0: mean 0.4; allowed: 0.433333",
    ),
    ("residuals", "residuals", "n", 2, 5, "residuals.parquet, row 2: n 5; allowed: 4, computed"),
    ("residuals", "residuals", "fold", 0, 1, "0 pooled rows of vec_vs_measured, train, position"),
    ("residuals", "residuals", "rms", 2, 0.9, "mean, rms and max out of order in row 2"),
    ("residuals", "residuals", "unit", 0, "mrad", "unit in row 0"),
    ("accuracy_map", "accuracy_map", "worst_branch", 1, "front", "worst_branch null in row 1"),
    ("accuracy_map", "accuracy_map", "position_max_mm", 1, 0.0, "position_max_mm null in row 1"),
    ("accuracy_map", "accuracy_map", "q2", 1, 0.5, "q2 null in row 1"),
    ("accuracy_map", "accuracy_map", "q3", 0, 30.0, "q3 beyond two turns in row 0"),
    ("accuracy_map", "accuracy_map", "solutions", 0, 19, "more combinations than tried in row 0"),
    ("assessment_points", "assessment_points", "true_error_mm", 1, 0.5, "true_error_mm in row 1"),
    ("assessment_points", "assessment_points", "point", 2, 5, "point out of sequence"),
    ("study", "study", "points_visited", 1, 4, "more points than measurements in row 1"),
    ("study", "study", "assessor", 0, "maximal", "no rows of maximal at 0.05 mm"),
    ("study", "study_summary", "mean_mm", 0, 0.31, "mean_mm 0.31 of maximum at 0.05 mm"),
    ("study", "study_summary", "repetitions", 1, 4, "repetitions 4"),
    ("study", "readings", "search", 3, None, "12 rows of model_invalidation at 0.05 mm"),
    ("study", "readings", "mean_mm", 0, 0.5, "mean_mm outside its range in row 0"),
    ("study", "readings", "bias_mm", 1, 0.3, "bias_mm in row 1"),
    ("histories", "histories", "true_mm", 0, 0.9, "true_mm in row 0"),
    ("histories", "histories", "repeat", 2, 1, "repeat in row 2"),
    ("histories", "histories", "eta_mm", 0, 0.9, "eta_mm of rejected varies"),
    ("histories", "histories", "iteration", 2, 9, "iterations of rejected"),
    ("claims", "claims", "verdict", 0, "differs", "verdict in row 0"),
    ("claims", "claims", "evidence", 0, "hearsay", "evidence 'hearsay'"),
    ("claims", "claims", "statistic", 1, "x", "statistic of less than two words in row 1"),
]


@pytest.mark.parametrize(("stage", "artefact", "column", "row", "value", "words"), RULES)
def test_rows_and_tables_that_contradict_each_other(
    results, stage, artefact, column, row, value, words
):
    results.change(stage, artefact, **put(results, artefact, column, row, value))
    found = problems(results)
    assert any(words in text for text in found), found


def test_a_second_pooled_row(results):
    table = results.tables["residuals"]
    doubled = {name: [*values, values[0]] for name, values in table.items()}
    results.change("residuals", "residuals", **doubled)
    the_one(problems(results), "2 pooled rows of vec_vs_measured, train, position")


def test_a_reading_left_out(results):
    table = results.tables["readings"]
    results.change(
        "study", "readings", **{name: list(values)[1:] for name, values in table.items()}
    )
    the_one(problems(results), "2 rows of outlier_rejection at 0.05 mm", "3, one per reading")


def test_a_summary_that_is_no_reading(results):
    table = results.tables["readings"]
    changed = [mean + 0.001 for mean in table["mean_mm"]]
    results.change("study", "readings", mean_mm=changed)
    found = problems(results)
    the_one(found, "study_summary.parquet, row 2: outlier_rejection at 0.05 mm agrees with no")


def test_an_input_changed_after_it_was_used(results):
    results.tables["measurements"]["x_mm"] = np.array([1.0, 2.0, 3.0, 4.0])
    results.save("measurements")
    found = problems(results)
    for name in ("vec_model", "dh_model", "residuals", "summary", "assessment_points"):
        the_one(found, f"{name}.parquet: was made from another measurements")
    the_one(found, "report.html: was made from another measurements")
    assert len(found) == 6, found


def test_parts_of_the_study_of_another_run(results):
    results.tables["assessment_points"]["s1"] = np.ones(3)
    results.save("assessment_points")
    results.save("study_chunk")
    found = problems(results)
    the_one(found, "study.parquet: was made from another assessment_points")
    the_one(found, "histories.parquet: was made from another assessment_points")
    the_one(found, "figures/fig5: was made from another assessment_points")


def test_tables_of_one_stage_from_two_runs(results):
    rewrite(
        results.path("dh_fit"),
        lambda table: table.replace_schema_metadata(table.schema.metadata | {b"code_hash": b"x"}),
    )
    the_one(problems(results), "dh_fit.parquet: code_hash x differs from code of dh_model")


@pytest.mark.parametrize("key", ["kinacc_version", "seed"])
def test_tables_of_two_versions_or_seeds(results, key):
    rewrite(
        results.path("claims"),
        lambda table: table.replace_schema_metadata(table.schema.metadata | {key.encode(): b"9"}),
    )
    the_one(problems(results), f"{key} ", "9 in claims")


def test_other_code_than_that_installed_is_a_note(results, monkeypatch):
    monkeypatch.setattr(provenance, "stage_code_hash", lambda *_: "newer")
    report = check.check_results(results.root)
    assert report.ok
    assert any("made with other code" in note for note in report.datasets[0].notes)


def test_a_robot_file_nobody_named_is_a_note_and_an_input_unlike_what_is_stated_a_problem(
    results, tmp_path
):
    (tmp_path / "own.yaml").write_text("a robot")
    results.files = {"robot_file": str(tmp_path / "own.yaml")}
    results.change("measurements", "measurements")
    report = check.check_results(results.root)
    assert report.ok, str(report)
    assert any("not checked without --config: robot_file" in n for n in report.datasets[0].notes)
    rewrite(
        results.path("dh_model"),
        lambda table: table.replace_schema_metadata(
            table.schema.metadata | {b"inputs_hash": b"0123456789abcdef"}
        ),
    )
    found = problems(results)
    the_one(found, "dh_model.parquet: inputs_hash is not that of its inputs_digests")


def test_what_a_stopped_run_left_is_a_note(results):
    (results.folder / ".study.parquet.12.partial").write_bytes(b"x")
    report = check.check_results(results.root)
    assert report.ok
    assert any("left over" in note for note in report.datasets[0].notes)


def test_robustness_of_claims_that_are_none(results):
    table = {"draw": [1], "claim": ["hearsay"], "reproduced": [None], "verdict": ["agrees"]}
    store.write(results.path("robustness"), "robustness", table, results.marks("claims"))
    assert any("unknown claim in row 0" in text for text in problems(results))


def test_shares_that_are_not_those_of_the_draws(results):
    names = ("draw", "claim", "reproduced", "verdict")
    rows = [(1, "agrees"), (2, "differs"), (3, "not comparable")]
    values = ([draw for draw, _ in rows], ["table_1.mean"] * 3, [0.7] * 3, [v for _, v in rows])
    table = dict(zip(names, values, strict=True))
    store.write(results.path("robustness"), "robustness", table, results.marks("claims"))
    assert any("share 1 of table_1.mean; allowed: 0.5" in text for text in problems(results))


@pytest.fixture
def plan():
    return planned([ROOT / "config.yaml"])


@pytest.fixture
def planned_results(tmp_path, monkeypatch, plan):
    """The small folder under the settings of a configuration, which made none of its numbers."""
    monkeypatch.setattr(provenance, "stage_code_hash", lambda *_: "code")
    monkeypatch.setattr(check, "computed_again", lambda *_: Again((), [], []))
    return SmallResults(tmp_path / "results", plan)


def test_a_good_folder_fits_its_configuration(planned_results, plan):
    report = check.check_results(planned_results.root, plan)
    assert report.ok, str(report)


def test_results_of_another_configuration(planned_results):
    other = planned([ROOT / "config.yaml"], {"study": {"alpha": 0.5}})
    report = check.check_results(planned_results.root, other)
    found = [str(problem) for problem in report.datasets[0].problems]
    the_one(found, "study_chunk/1-of-2.parquet: config_hash", "another configuration")
    the_one(found, "histories.parquet: config_hash", "another configuration")
    assert not any("vec_model" in text for text in found)


def test_results_of_another_seed(planned_results):
    other = planned([ROOT / "config.yaml"], {"seed": 1})
    report = check.check_results(planned_results.root, other)
    assert any("seed 20240" in str(problem) for problem in report.datasets[0].problems)


def test_a_data_set_that_was_not_run(planned_results, tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text("datasets: {second: {robot: mh180}}\n")
    report = check.check_results(planned_results.root, planned([ROOT / "config.yaml", own]))
    assert not report.ok
    assert "second: no such folder" in str(report)
