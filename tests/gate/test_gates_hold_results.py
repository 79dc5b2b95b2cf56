"""What becomes of a gate, by the tables of a run; each is what somebody's pipeline meets."""

import numpy as np
import pytest

from kinacc.config.load import load
from kinacc.gate.gates import of_gate
from kinacc.gate.outcome import FAILED, PASSED, UNDECIDED, WARNED
from kinacc.gate.run_tables import RunTables
from kinacc.tables import store, sums


def gate(tmp_path, text, tolerance="{}"):
    path = tmp_path / "gate.yaml"
    whole = f"gates: [{{name: g, {text}}}]\ntolerance: {tolerance}\n"
    path.write_text(whole + "datasets: {mh180: {robot: mh180}}\n")
    full = load([path], folder=tmp_path)["mh180"]
    return full["gates"][0], full["tolerance"]


def vectors(count, seed=1, scale=1.0):
    return scale * np.random.default_rng(seed).normal(size=(count, 3))


def run(folder, errors, measured_as=0):
    """A run whose selected model dh has these errors (n, 3) held out, one a pose."""
    count = len(errors)
    tables = RunTables(folder)
    joints = {f"q{j}": np.linspace(0.0, 1.0, count) for j in range(1, 7)}
    half = {f"e{axis}_mm": np.tile(errors[:, i], 2) * ([0.5] * count + [1.0] * count)
            for i, axis in enumerate("xyz")}  # fmt: skip
    turns = {f"r{axis}_mrad": np.full(2 * count, np.nan) for axis in "xyz"}
    tables["pose_errors"] = {
        "comparison": np.array(["dh_vs_measured"] * 2 * count, object),
        "estimate": np.array(["train"] * count + ["cross_validated"] * count, object),
        "row": np.tile(np.arange(count), 2),
        "subset": np.array((["validation"] * (count // 5) + ["train"] * count)[:count] * 2, object),
        **half,
        **turns,
    }
    tables["model_selection"] = {"model": np.array(["vec", "dh"]), "selected": np.array([0, 1])}
    tables["measurements"] = {"pose": np.arange(count), **joints, "row": np.full(count, np.nan)}
    folder.mkdir(parents=True, exist_ok=True)
    marks = {"kinacc_version": "0", "config_hash": "c", "seed": 1}
    table = store.to_table("measurements", _measured(count, measured_as), marks)
    content = store.content_of(table)
    (folder / "measurements.parquet").write_bytes(content)
    (folder / sums.FOLDER).mkdir(exist_ok=True)
    listed = sums.text_of({"measurements.parquet": content}, {})
    (folder / sums.FOLDER / "measurements.sha256").write_bytes(listed)
    return tables


def _measured(count, seed):
    place = np.random.default_rng(seed).normal(size=(count, 3))
    return {
        "pose": np.arange(count),
        **{f"q{j}": np.linspace(0.0, 1.0, count) for j in range(1, 7)},
        **{f"s{j}": np.zeros(count, int) for j in range(1, 7)},
        "target": ["tool"] * count,
        **{f"{axis}_mm": place[:, i] for i, axis in enumerate("xyz")},
        "qw": np.ones(count),
        **{f"q{axis}": np.zeros(count) for axis in "xyz"},
        "repeat": np.zeros(count, int),
        "subset": ["train"] * count,
        "fold": [np.nan] * count,
    }


def judged(tmp_path, text, tables, accepted=None, tolerance="{}"):
    asked, known = gate(tmp_path, text, tolerance)
    return of_gate(asked, "mh180", tables, known, accepted)


@pytest.mark.parametrize(
    ("statistic", "of"),
    [
        ("mean", lambda x: x.mean()),
        ("rms", lambda x: np.sqrt((x**2).mean())),
        ("p99", lambda x: np.sort(x)[147] + 0.51 * (np.sort(x)[148] - np.sort(x)[147])),
        ("largest", lambda x: x.max()),
    ],
)
def test_a_figure_is_held_to_its_limit_on_either_side_of_it(tmp_path, statistic, of):
    errors = vectors(150)
    tables, size = run(tmp_path / "r", errors), of(np.linalg.norm(errors, axis=1))
    name = f"value: residuals.position.{statistic}"
    above = judged(tmp_path, f"{name}, at_most_mm: {size * 1.001}", tables)
    assert (above.verdict, above.fix) == (PASSED, "")
    assert above.figures["value_mm"] == pytest.approx(size)
    below = judged(tmp_path, f"{name}, at_most_mm: {size * 0.999}", tables)
    assert below.verdict == FAILED
    assert f"is {size:.3f} mm; at most {size * 0.999:.3f} mm is allowed" in below.says
    least = judged(tmp_path, f"{name}, at_least_mm: {size * 1.001}", tables)
    assert least.verdict == FAILED


def test_a_percentile_says_whether_it_is_empirical_or_of_a_distribution(tmp_path):
    tables = run(tmp_path / "r", vectors(150))
    empirical = judged(tmp_path, "value: residuals.position.p99, at_most_mm: 9", tables)
    fitted = judged(tmp_path, "value: residuals.position.p99_gamma, at_most_mm: 9", tables)
    assert "empirical 99 % quantile of the position errors held out (DH model)" in empirical.says
    assert empirical.figures["statistic"] == "empirical 99 % quantile"
    assert "99 % gamma quantile" in fitted.says
    assert fitted.figures["statistic"] == "99 % gamma quantile"
    assert fitted.figures["value_mm"] != empirical.figures["value_mm"]


def test_other_rows_are_asked_for_by_name(tmp_path):
    errors = vectors(100)
    tables, sizes = run(tmp_path / "r", errors), np.linalg.norm(errors, axis=1)
    for at, wanted in {"training": 0.5 * sizes, "validation": sizes[:20]}.items():
        text = f"value: residuals.position.mean, at: {at}, at_most_mm: 9"
        found = judged(tmp_path, text, tables)
        assert found.figures["value_mm"] == pytest.approx(wanted.mean())
        assert found.figures["rows"] == len(wanted)


def test_few_rows_fail_a_percentile_and_cannot_pass_it(tmp_path):
    tables = run(tmp_path / "r", vectors(60))
    name = "value: residuals.position.p99"
    assert judged(tmp_path, f"{name}, at_most_mm: 0.5", tables).verdict == FAILED
    for undecided, verdict in {"fail": FAILED, "warn": WARNED, "pass": UNDECIDED}.items():
        text = f"{name}, at_most_mm: 9, undecided: {undecided}"
        found = judged(tmp_path, text, tables)
        assert found.verdict == verdict
        assert "60 rows are too few to tell of 1 % of them" in found.says


def test_a_failure_that_only_warns_fails_nothing(tmp_path):
    tables = run(tmp_path / "r", vectors(60))
    text = "value: data.poses, at_least: 61, on_fail: warn"
    found = judged(tmp_path, text, tables)
    assert found.verdict == WARNED
    assert "number of poses is 60; at least 61 is asked for" in found.says


def test_the_tolerance_of_the_configuration_is_the_limit_and_is_named(tmp_path):
    tables = run(tmp_path / "r", vectors(150))
    found = judged(
        tmp_path, "value: residuals.position.mean", tables, tolerance="{mm: 0.5, of: mean}"
    )
    assert found.verdict == FAILED
    assert "at most 0.500 mm is allowed by the tolerance of the configuration" in found.says


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("value: residuals.position.mean, at_most_mm: 1", "kinacc calibrate FILE.yaml"),
        ("claims: agree", "kinacc study FILE.yaml"),
        ("history: holds", "series"),
        ("suspicions: none", "kinacc calibrate FILE.yaml"),
        ("value: bound.upper, at_most_mm: 1", "workflow"),
        ("campaign: check, tolerance_mm: 1", "kinacc campaign start"),
    ],
)
def test_a_gate_whose_table_is_not_there_fails_and_says_what_makes_it(tmp_path, text, names):
    found = judged(tmp_path, text, RunTables(tmp_path / "nothing"))
    assert found.verdict == FAILED
    assert names in found.fix


def test_a_worse_model_at_the_same_poses_fails_and_is_told_by_how_much(tmp_path):
    errors = vectors(200)
    accepted = run(tmp_path / "a", errors)
    tables = run(tmp_path / "r", 1.1 * errors)
    text = "value: residuals.position.mean, against: accepted, allow_mm: 0.02"
    found = judged(tmp_path, text, tables, accepted)
    size = np.linalg.norm(errors, axis=1).mean()
    assert found.verdict == FAILED
    assert found.kind == "change"
    assert found.figures["worse_by_mm"] == pytest.approx(0.1 * size)
    assert 0.02 < found.figures["worse_by_at_least_mm"] < 0.1 * size
    assert f"{0.1 * size:.3f} mm worse than the accepted run's {size:.3f} mm" in found.says
    assert "200 poses of the same measurements" in found.says
    assert "99 % confidence" in found.says


def test_the_same_difference_at_other_poses_may_be_chance(tmp_path):
    accepted = run(tmp_path / "a", vectors(200))
    tables = run(tmp_path / "r", 1.02 * vectors(180, seed=2), measured_as=1)
    text = "value: residuals.position.mean, against: accepted, allow_mm: 0"
    found = judged(tmp_path, text, tables, accepted)
    assert found.verdict == PASSED
    assert found.figures["paired"] == 0
    assert "180 poses and the accepted run's 200" in found.says


def test_a_run_that_is_the_accepted_one_is_not_worse_however_little_is_allowed(tmp_path):
    accepted, tables = (run(tmp_path / name, vectors(5)) for name in "ar")
    text = "value: residuals.position.largest, against: accepted, allow_mm: 0"
    assert judged(tmp_path, text, tables, accepted).verdict == PASSED


def test_a_largest_error_of_another_number_of_poses_decides_nothing(tmp_path):
    accepted = run(tmp_path / "a", vectors(200))
    tables = run(tmp_path / "r", 9.0 * vectors(400, seed=2), measured_as=1)
    text = "value: residuals.position.largest, against: accepted, allow_mm: 0.1"
    found = judged(tmp_path, f"{text}, undecided: pass", tables, accepted)
    assert found.verdict == UNDECIDED
    assert "a maximum of 400 errors says nothing beside one of 200; use p99" in found.says


def test_without_an_accepted_run_a_gate_against_it_fails(tmp_path):
    tables = run(tmp_path / "r", vectors(50))
    text = "value: residuals.position.mean, against: accepted, allow_mm: 0.1"
    for accepted in (None, RunTables(tmp_path / "nothing")):
        found = judged(tmp_path, text, tables, accepted)
        assert found.verdict == FAILED
        assert "--accept FOLDER" in found.fix


def with_claims(tmp_path, **verdicts):
    tables = RunTables(tmp_path)
    names, said = list(verdicts), list(verdicts.values())
    tables["claims"] = {
        "claim": np.array(names, object),
        "verdict": np.array(said, object),
        "used_to_choose": np.array([name.startswith("map_") for name in names]),
    }
    return tables


def test_a_sentence_that_chose_a_reading_is_no_evidence(tmp_path):
    tables = with_claims(tmp_path, one="agrees", map_nonlinear="differs")
    for text in ("claims: agree", "claims: agree, except: [map_nonlinear]"):
        found = judged(tmp_path, text, tables)
        assert found.verdict == PASSED
        assert found.figures["claims"] == found.figures["agree"] == 1


def test_claims_that_differ_fail_unless_they_are_excepted(tmp_path):
    tables = with_claims(tmp_path, one="agrees", two="differs", three="not comparable")
    found = judged(tmp_path, "claims: agree", tables)
    assert found.verdict == FAILED
    assert "not excepted: two" in found.says
    assert "not comparable: three" in found.says
    found = judged(tmp_path, "claims: agree, except: [two, one]", tables)
    assert found.verdict == PASSED
    assert "excepted, though they agree: one" in found.says


def test_an_exception_that_names_no_claim_fails_and_names_the_one_meant(tmp_path):
    tables = with_claims(tmp_path, map_nonlinear="agrees")
    found = judged(tmp_path, "claims: agree, except: [map_nonlinaer]", tables)
    assert found.verdict == FAILED
    assert "did you mean map_nonlinear?" in found.fix


def checked(tmp_path, *accepted):
    tables = RunTables(tmp_path)
    tables["measurements"] = {"row": np.array([2.0, 3.0])}
    rows = [("outliers", "warning", "line 3 is far off", each) for each in accepted]
    rows += [("few_poses", "note", "there are few", None), ("left_out", "note", "a column", None)]
    columns = zip(*rows, strict=True)
    named = zip(("finding", "level", "what", "accepted"), columns, strict=True)
    tables["data_check"] = {name: np.array(values, object) for name, values in named}
    return tables


@pytest.mark.parametrize(
    ("asked", "accepted", "verdict"),
    [
        ("none", (), PASSED),
        ("none", ("seen and fine",), FAILED),
        ("known", ("seen and fine",), PASSED),
        ("known", ("seen and fine", None), FAILED),
    ],
)
def test_suspicions_are_none_or_known_and_notes_are_none(tmp_path, asked, accepted, verdict):
    found = judged(tmp_path, f"suspicions: {asked}", checked(tmp_path, *accepted))
    assert found.verdict == verdict
    assert ("outliers: line 3 is far off" in found.says) == (verdict == FAILED)


@pytest.mark.parametrize(
    ("verdict", "becomes", "says"),
    [
        ("first", PASSED, "the first line of its series"),
        ("holds", PASSED, "the last calibration still holds"),
        ("recalibrate", FAILED, "recalibrate: 0.30 mm beyond chance, joint 4"),
        ("cannot be told", WARNED, "whether the calibration of 2026-03-01 still holds cannot"),
    ],
)
def test_the_newest_line_of_a_history_decides(tmp_path, verdict, becomes, says):
    tables = RunTables(tmp_path)
    names = ("moved_mm", "chance_mm", "beyond_mm", "probability")
    tables["history"] = {
        "series": ["arm-2026-03-01", "arm-2026-06-02"],
        "date": ["2026-03-01", "2026-06-02"],
        "in_force": [None, "arm-2026-03-01"],
        "joint": [np.nan, 4],
        "verdict": ["recalibrate", verdict],
        "reason": [None, "too few poses"],
        **{name: [np.nan, 0.3] for name in names},
    }
    found = judged(tmp_path, "history: holds, undecided: warn", tables)
    assert found.verdict == becomes
    assert f"arm-2026-06-02: {says}" in found.says
    assert found.figures["moved_mm"] == 0.3
    moved = judged(tmp_path, "value: history.moved, at_most_mm: 0.2", tables)
    assert moved.verdict == FAILED
