"""Runs held to the accepted one: what is the same, what is another, and what explains it."""

from __future__ import annotations

import shutil
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pyarrow.parquet as pq
import pytest
from runs_by_hand import KEYS, Run, put_in

from kinacc.artifacts import records, store
from kinacc.artifacts.contract import ARTEFACTS
from kinacc.errors import InputError
from kinacc.gate.causes import Causes
from kinacc.gate.golden import compared
from kinacc.gate.made import made
from kinacc.gate.outcome import (
    CODE,
    CONFIGURATION,
    FAILED,
    INPUT,
    PASSED,
    SEED,
    UNEXPLAINED,
    VERSION,
)
from kinacc.gate.table_comparison import within_chance
from kinacc.workflow.catalogue import STAGES


@pytest.fixture
def held(tmp_path):
    """What becomes of a run held to another one, both as they are told to be made."""

    def outcome(accepted: Run, now: Run, exact: bool = False, parts: int = 2):
        (found,) = compared(
            now.write(tmp_path / "now", parts), accepted.write(tmp_path / "accepted"), exact=exact
        )
        return found

    return outcome


def told(outcome) -> dict[tuple[str, str], set[tuple[str, str]]]:
    """By artefact and column the kinds and places of the causes."""
    return {
        (each.artefact, each.column): {(cause.kind, cause.where) for cause in each.causes}
        for each in outcome.differences
    }


def artefacts(outcome) -> set[str]:
    return {each.artefact for each in outcome.differences}


def scaled(run: Run, artefact: str, column: str, by: float):
    """A run whose column of a table is larger by an amount in the first row."""
    values = np.array(run.tables[artefact][column], float)
    values[0] += by
    return run.with_table(artefact, **{column: values})


def test_a_run_made_again_in_another_folder_and_other_parts_is_the_same(held):
    outcome = held(Run(), Run(), parts=5)
    assert (outcome.verdict, outcome.differences) == (PASSED, ())
    assert "although" not in outcome.says


@pytest.mark.parametrize(
    ("artefact", "column", "within", "beyond"),
    [
        ("measurements", "x_mm", 9e-7, 2e-6),
        ("measurements", "q2", 9e-10, 2e-9),
        ("residuals", "mean", 9e-7, 2e-6),
        ("assessment_points", "true_error_mm", 9e-7, 2e-6),
        ("dh_model", "std_alpha_rad", 9e-10, 2e-9),
        ("dh_covariance", "covariance", 1e-8, 1e-7),
    ],
)
def test_rounding_of_another_machine_passes_and_a_change_beyond_it_does_not(
    held, artefact, column, within, beyond
):
    assert held(Run(), scaled(Run(), artefact, column, within)).verdict == PASSED
    outcome = held(Run(), scaled(Run(), artefact, column, beyond))
    assert outcome.verdict == FAILED
    found = outcome.differences[0]
    assert (found.artefact, found.column, found.rows) == (artefact, column, 1)
    assert found.largest == pytest.approx(beyond, rel=1e-5)
    assert found.allowed < beyond
    assert found.first


def test_whole_numbers_words_and_null_are_equal_or_they_differ(held):
    for column, values in {
        "n": [7, 6],
        "unit": ["mrad", "mrad"],
        "gamma99": [0.9, 1.0],
        "quantity": ["position", "position"],
    }.items():
        now = Run().with_table("residuals", **{column: values})
        if column == "quantity":
            now = now.with_table("residuals", subset=["train", "validation"])
        outcome = held(Run(), now)
        assert artefacts(outcome) == {"residuals"}, column
    (found,) = held(Run(), Run().with_table("residuals", gamma99=[np.nan, np.nan])).differences
    assert "0.9 before, null now" in found.what
    assert found.first == "comparison=dh_vs_measured, subset=train, quantity=position"


def test_rows_more_and_fewer_are_told_by_their_key(held):
    fewer = {name: np.asarray(values)[1:] for name, values in Run().tables["dh_covariance"].items()}
    now = replace(Run(), tables={**Run().tables, "dh_covariance": fewer})
    (found,) = held(Run(), now).differences
    assert (found.what, found.first) == ("1 row fewer", "parameter=j1.d_mm, other=j1.d_mm")
    (found,) = held(now, Run()).differences
    assert found.what == "1 row more"


def test_rows_in_another_order_are_the_same(held):
    turned = {
        name: np.asarray(values)[::-1] for name, values in Run().tables["dh_covariance"].items()
    }
    now = replace(Run(), tables={**Run().tables, "dh_covariance": turned})
    assert held(Run(), now).verdict == PASSED


def test_parameters_that_only_count_together_may_trade(held):
    d_mm = np.array(Run().tables["dh_model"]["d_mm"])
    traded = d_mm.copy()
    traded[[1, 2]] += 5.0  # axes 2 and 3 are parallel, and point to opposite sides
    assert held(Run(), Run().with_table("dh_model", d_mm=traded)).verdict == PASSED
    alone = d_mm.copy()
    alone[1] += 5.0
    outcome = held(Run(), Run().with_table("dh_model", d_mm=alone))
    (found,) = outcome.differences
    assert (found.artefact, found.column) == ("dh_model", "d_mm")
    assert "poses predicted where was measured differ by up to 5 mm" in found.what


def test_a_base_that_moves_against_the_tool_differs_and_rounding_of_both_does_not(held):
    moved = np.array(Run().tables["frames"]["x_mm"])
    moved[2] = 1e-7
    assert held(Run(), Run().with_table("frames", x_mm=moved)).verdict == PASSED
    moved[2] = 1e-3
    assert artefacts(held(Run(), Run().with_table("frames", x_mm=moved))) == {"frames"}


def changed(run: Run, stages: tuple[str, ...]) -> Run:
    """A run whose tables of these stages have other numbers."""
    for artefact, column in (
        ("measurements", "x_mm"),
        ("dh_model", "std_d_mm"),
        ("residuals", "mean"),
        ("assessment_points", "true_error_mm"),
    ):
        if artefact.removesuffix("_model") in stages:
            run = scaled(run, artefact, column, 0.1)
    return run


ALL = ("measurements", "dh", "residuals", "assessment_points")


def test_another_number_in_the_measured_file_explains_all_that_follows(held):
    now = changed(replace(Run(), data="june"), ALL)
    outcome = held(Run(), now)
    assert set.union(*told(outcome).values()) == {(INPUT, "measurements.file.path (march.csv)")}
    assert "all of it follows from data changed: measurements.file.path (march.csv)" in outcome.says
    assert "kinacc accept" in outcome.fix


def test_another_value_of_the_configuration_is_named_with_what_stood_there(held):
    other = {"calibration": {"dh": {"truncation": 0.1}}}
    now = changed(Run().with_keys("dh", **other).with_keys("residuals", **other), ALL[1:])
    outcome = held(Run(), now)
    (cause,) = {cause for each in outcome.differences for cause in each.causes}
    assert (cause.kind, cause.where) == (CONFIGURATION, "calibration.dh.truncation")
    assert (cause.before, cause.after) == ("0.01", "0.1")


def test_code_explains_what_it_leads_to_and_nothing_else(held):
    now = changed(Run().with_code("residuals", "kinacc.calibration.residuals"), ("residuals",))
    now = changed(now.with_code("dh", "kinacc.calibration.dh_fit"), ("dh",))
    found = told(held(Run(), now))
    of_dh, of_residuals = (
        (CODE, "kinacc.calibration.dh_fit"),
        (
            CODE,
            "kinacc.calibration.residuals",
        ),
    )
    assert found["dh_model", "std_d_mm"] == {of_dh}
    assert found["residuals", "mean"] == {of_dh, of_residuals}


def test_a_library_and_python_are_named_by_their_versions(held):
    now = changed(replace(Run(), versions={"python": "3.13", "numpy": "2.2"}), ("dh",))
    (found,) = held(Run(), now).differences
    assert {(each.kind, each.where, each.before, each.after) for each in found.causes} == {
        (VERSION, "Python", "3.12", "3.13"),
        (VERSION, "numpy", "2.1", "2.2"),
    }


def test_a_release_is_a_version_and_not_the_module_that_says_it(held):
    now = changed(replace(Run(), kinacc="0.2.0"), ("dh",))
    assert told(held(Run(), now)) == {("dh_model", "std_d_mm"): {(VERSION, "kinacc")}}


def test_a_change_that_moves_no_number_passes_and_is_mentioned(held):
    outcome = held(Run(), Run().with_code("dh", "kinacc.calibration.dh_fit"))
    assert outcome.verdict == PASSED
    assert "although something changed: code changed: kinacc.calibration.dh_fit" in outcome.says


def test_a_number_that_nothing_explains_reads_differently(held):
    outcome = held(Run(), changed(Run(), ("dh",)))
    assert told(outcome) == {("dh_model", "std_d_mm"): {(UNEXPLAINED, "dh")}}
    assert outcome.says == (
        "dh_model differs from the accepted run, though nothing that it is made from has changed"
    )
    assert "check-results" in outcome.fix


def test_an_edited_table_is_unexplained_even_where_something_else_changed(held, tmp_path):
    Run().write(tmp_path / "accepted")
    results = Run().with_code("dh", "kinacc.calibration.dh_fit").write(tmp_path / "now")
    path = results / "arm" / "dh_model.parquet"
    table = pq.read_table(path)
    stds = [0.5, *table["std_d_mm"].to_pylist()[1:]]
    place = table.schema.get_field_index("std_d_mm")
    pq.write_table(table.set_column(place, table.schema.field("std_d_mm"), [stds]), path)
    (outcome,) = compared(results, tmp_path / "accepted")
    assert told(outcome) == {("dh_model", "std_d_mm"): {(UNEXPLAINED, "dh_model")}}


@pytest.mark.parametrize("with_record", [False, True])
def test_a_table_of_another_run_is_told_for_what_it_is(tmp_path, with_record):
    other = changed(replace(Run(), data="june"), ("measurements", "dh", "residuals")).write(
        tmp_path / "other"
    )
    accepted, results = Run().write(tmp_path / "accepted"), Run().write(tmp_path / "now")
    names = ["dh_model.parquet", "frames.parquet", "dh_fit.parquet", "dh_covariance.parquet"]
    put_in(other, results, *names, *(["records/dh.json"] if with_record else []))
    (outcome,) = compared(results, accepted)
    assert artefacts(outcome) >= {"dh_model"}
    assert all(not each.explained for each in outcome.differences)
    if with_record:
        assert "was not made from what is here" in outcome.says
    assert "residuals" not in artefacts(outcome)


def test_a_study_of_another_run_with_its_record_was_not_made_from_these_parts(tmp_path):
    other = drawn(2, 40).write(tmp_path / "other")
    accepted, results = Run().write(tmp_path / "accepted"), Run().write(tmp_path / "now")
    put_in(other, results, "study.parquet", "study_summary.parquet", "records/study.json")
    (outcome,) = compared(results, accepted)
    assert artefacts(outcome) == {"study", "study_summary"}
    assert "study was not made from what is here: made from study_chunk" in outcome.says


def test_a_lost_table_and_a_stage_of_one_run_alone(tmp_path):
    accepted, results = Run().write(tmp_path / "accepted"), Run().write(tmp_path / "now")
    (results / "arm" / "dh_model.parquet").unlink()
    (found,) = compared(results, accepted)[0].differences
    assert (found.artefact, found.explained) == ("dh_model", False)
    (results / "arm" / "records" / "dh.json").unlink()
    (outcome,) = compared(results, accepted)
    assert artefacts(outcome) == {"dh_model", "frames", "dh_fit", "dh_covariance"}


def test_records_of_before_settings_and_code_were_told_still_explain_by_their_hashes(held):
    old = replace(Run(), told=False)
    now = changed(old.with_code("dh", "kinacc.calibration.dh_fit"), ("dh",))
    assert told(held(old, now)) == {("dh_model", "std_d_mm"): {(CODE, "code or versions")}}
    other = {"calibration": {"dh": {"truncation": 0.1}}}
    found = told(held(old, changed(Run().with_keys("dh", **other), ("dh",))))
    assert {kind for kind, _ in found["dh_model", "std_d_mm"]} == {CONFIGURATION}


def drawn(seed: int, repetitions: int) -> Run:
    own = {**KEYS["study_chunk"]["study"], "repetitions": repetitions}
    return Run().with_keys("study_chunk", seed=seed, study=own)


@pytest.mark.parametrize(("seed", "repetitions"), [(2, 40), (1, 90), (3, 60)])
def test_a_study_drawn_anew_is_held_to_its_standard_errors(held, seed, repetitions):
    outcome = held(Run(), drawn(seed, repetitions))
    assert outcome.verdict == PASSED
    assert "held to study_summary.std_error_mm" in outcome.says


def test_a_study_of_three_repetitions_drawn_anew_raises_no_alarm():
    from runs_by_hand import _study

    artefact = ARTEFACTS["study_summary"]
    marks = dict.fromkeys(store.PROVENANCE_KEYS, "-")
    drawn_anew = [
        store.to_table(artefact.name, _study(seed, 3)[artefact.name], marks) for seed in range(60)
    ]
    # Held to a normal distribution several would be told.
    assert not any(within_chance(artefact, *pair) for pair in pairwise(drawn_anew))


def test_a_release_beside_more_repetitions_is_no_reason_to_ask_for_the_same_simulations(held):
    outcome = held(Run(), drawn(1, 90).with_code("study_chunk", "kinacc.study.monte_carlo"))
    assert outcome.verdict == PASSED


def test_a_study_drawn_anew_whose_means_are_others_is_told(held, monkeypatch):
    import runs_by_hand

    accepted, real = drawn(1, 40), runs_by_hand._study

    def worse(seed, repetitions):
        found = real(seed, repetitions)
        if seed != 1:
            found["study_summary"]["mean_mm"] += 0.4
        return found

    monkeypatch.setattr(runs_by_hand, "_study", worse)
    (found,) = held(accepted, drawn(2, 40)).differences
    assert (found.artefact, found.column) == ("study_summary", "mean_mm")
    assert "standard errors (study_summary.std_error_mm)" in found.what
    assert {(each.kind, each.where) for each in found.causes} == {(SEED, "seed")}


def test_the_same_seed_and_repetitions_ask_for_the_same_simulations(tmp_path, monkeypatch):
    import runs_by_hand

    accepted, real = Run().write(tmp_path / "accepted"), runs_by_hand._study
    monkeypatch.setattr(runs_by_hand, "_study", lambda _, repetitions: real(9, repetitions))
    (outcome,) = compared(Run().write(tmp_path / "now"), accepted)
    assert artefacts(outcome) == {"study_chunk", "study", "study_summary", "claims"}
    assert ("study_chunk", "assessed_mm") in told(outcome)
    assert all(not each.explained for each in outcome.differences if "chunk" in each.artefact)


def test_claims_on_a_study_drawn_anew_are_left_aside_and_others_are_not(tmp_path, monkeypatch):
    import runs_by_hand

    accepted, real = Run().write(tmp_path / "accepted"), runs_by_hand._study

    def worse(seed, repetitions):
        found = real(seed, repetitions)
        found["claims"]["verdict"][0] = "differs"
        return found

    monkeypatch.setattr(runs_by_hand, "_study", worse)
    (outcome,) = compared(drawn(2, 40).write(tmp_path / "now"), accepted)
    (found,) = outcome.differences
    assert (found.artefact, found.column, found.first) == (
        "claims",
        "verdict",
        "claim=table_3.mean",
    )


def test_another_setting_of_a_stage_beside_more_repetitions_is_compared_by_numbers(held):
    now = drawn(1, 90).with_keys("study", study={"search": "bisection"})
    found = told(held(Run(), now))
    assert {name for name, _ in found} == {"study", "study_summary", "claims"}
    assert {where for _, where in found["study_summary", "mean_mm"]} == {
        "study.repetitions",
        "study.search",
    }


def test_a_study_of_other_points_is_compared_number_by_number(held):
    outcome = held(Run(), changed(drawn(2, 40), ("assessment_points",)))
    assert {"study_chunk", "study", "study_summary"} <= artefacts(outcome)


def test_exact_asks_for_bytes_and_says_why_they_are_others(held):
    assert held(Run(), Run(), exact=True).verdict == PASSED
    outcome = held(Run(), Run().with_code("dh", "kinacc.calibration.dh_fit"), exact=True)
    assert "dh_model.parquet" in artefacts(outcome)
    causes = {cause for each in outcome.differences for cause in each.causes}
    assert {(each.kind, each.where) for each in causes} == {(CODE, "kinacc.calibration.dh_fit")}


def test_a_table_of_several_data_sets_is_explained_by_what_changed_in_them(tmp_path):
    runs = {"accepted": Run(), "now": changed(replace(Run(), data="june"), ALL)}
    for name, run in runs.items():
        run.write(tmp_path / name)
        digest = made(tmp_path / name / "arm").digest("residuals", STAGES["residuals"])
        read = {"arm/residuals": digest}
        if name == "now":
            read["new/residuals"] = digest
        record = records.Record("history", None, {}, read, {}, {}, {}, {"python": "3.12"})
        records.leave(records.place(tmp_path / name / "tracker", "history"), record, {})
    both = Causes(made(tmp_path / "accepted" / "tracker"), made(tmp_path / "now" / "tracker"))
    assert {(each.kind, each.where, each.before) for each in both.of_stage("history")} == {
        (INPUT, "measurements.file.path (march.csv)", both.of_stage("history")[0].before),
        (INPUT, "new", "not read"),
    }


def test_a_data_set_of_one_run_alone(tmp_path):
    accepted, results = Run().write(tmp_path / "accepted"), Run().write(tmp_path / "now")
    shutil.copytree(results / "arm", results / "new")
    shutil.copytree(accepted / "arm", accepted / "gone")
    found = {each.dataset: each for each in compared(results, accepted)}
    assert [found[name].verdict for name in ("arm", "gone", "new")] == [PASSED, FAILED, FAILED]
    assert [each.dataset for each in compared(results, accepted, ["arm"])] == ["arm"]


def test_a_record_that_cannot_be_read_is_told_and_one_of_the_accepted_run_refused(tmp_path):
    accepted, results = Run().write(tmp_path / "accepted"), Run().write(tmp_path / "now")
    (results / "arm" / "records" / "dh.json").write_text("{")
    (outcome,) = compared(results, accepted)
    assert "dh.json" in artefacts(outcome)
    (accepted / "arm" / "records" / "dh.json").write_text("{")
    with pytest.raises(InputError, match="is no record of a stage"):
        compared(results, accepted)


def test_an_accepted_table_that_is_not_as_it_was_accepted_is_refused(tmp_path):
    accepted, results = Run().write(tmp_path / "accepted"), Run().write(tmp_path / "now")
    (accepted / "arm" / "frames.parquet").write_bytes(b"other")
    with pytest.raises(InputError, match=r"frames\.parquet"):
        compared(results, accepted)


def test_no_accepted_run_is_said_with_the_command_that_makes_one(tmp_path):
    with pytest.raises(InputError, match="kinacc accept RESULTS --reason"):
        compared(Run().write(tmp_path / "now"), tmp_path / "accepted")
