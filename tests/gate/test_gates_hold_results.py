"""Outcomes of gates by the tables of a run, as a pipeline meets them."""

import numpy as np
import pandas as pd
import pytest
from shared_data import RESULTS

from kinacc.checks.configuration import load
from kinacc.gate.gates import of_gate
from kinacc.gate.outcome import FAILED, PASSED, UNDECIDED, WARNED
from kinacc.gate.values import RunTables, figure
from kinacc.tables import sums

MEAN = "value: residuals.position.mean"
SINCE = f"{MEAN}, against: accepted"


def vectors(count, seed=1):
    return np.random.default_rng(seed).normal(size=(count, 3))


def run(folder, errors, measured_as=b"0"):
    """A run whose selected model dh has these errors (n, 3) held out, one a pose, and half of them
    at training poses."""
    count, tables = len(errors), RunTables(folder)
    both = np.concatenate([0.5 * errors, errors])
    tables["pose_errors"] = pd.DataFrame(
        {
            "comparison": "dh_vs_measured",
            "estimate": np.repeat(["train", "cross_validated"], count),
            "row": np.tile(np.arange(count), 2),
            "subset": np.tile(np.where(np.arange(count) < count // 5, "validation", "train"), 2),
            **{f"e{axis}_mm": both[:, i] for i, axis in enumerate("xyz")},
        }
    )
    tables["model_selection"] = pd.DataFrame({"model": ["vec", "dh"], "selected": [0, 1]})
    joints = {f"q{j}": np.linspace(0.0, 1.0, count) for j in range(1, 7)}
    tables["measurements"] = pd.DataFrame({"pose": np.arange(count), **joints})
    (folder / sums.FOLDER).mkdir(parents=True, exist_ok=True)
    listed = sums.text_of({"measurements.parquet": measured_as}, {})
    (folder / sums.FOLDER / "measurements.sha256").write_bytes(listed)
    return tables


def tables_of(tmp_path, **tables):
    found = RunTables(tmp_path)
    found.update({name: pd.DataFrame(columns) for name, columns in tables.items()})
    return found


def judged(tmp_path, text, tables, accepted=None, tolerance="{}"):
    path = tmp_path / "gate.yaml"
    whole = f"gates: [{{name: g, {text}}}]\ntolerance: {tolerance}\n"
    path.write_text(whole + "datasets: {mh180: {robot: mh180}}\n")
    full = load([path], folder=tmp_path)["mh180"]
    return of_gate(full["gates"][0], tables, full["tolerance"]["mm"], accepted)


def test_a_figure_is_held_to_its_limit_on_either_side_of_it(tmp_path):
    errors, name = vectors(100), "value: residuals.position.p99"
    ordered = np.sort(np.linalg.norm(errors, axis=1))
    tables, size = run(tmp_path / "r", errors), ordered[98] + 0.01 * (ordered[99] - ordered[98])
    above = judged(tmp_path, f"{name}, at_most_mm: {size * 1.001}", tables)
    assert above.verdict == PASSED
    assert above.figures["value_mm"] == pytest.approx(size)
    assert judged(tmp_path, f"{name}, at_most_mm: {size * 0.999}", tables).verdict == FAILED


def test_figures_are_those_of_the_table_of_residuals():
    tables = RunTables(RESULTS / "ur10_d")
    table = tables["residuals"].query("subset == 'validation' and fold.isna()")
    pooled = table.set_index(["comparison", "quantity"]).loc["dh_vs_measured", "orientation"]
    names = {"mean": "mean", "rms": "rms", "largest": "max", "p99_gamma": "gamma99"}
    for statistic, column in names.items():
        gate = {"value": f"residuals.orientation.{statistic}", "model": "dh"}
        assert figure(tables, gate).size == pytest.approx(pooled[column], rel=1e-9)


@pytest.mark.parametrize(
    ("text", "tolerance", "verdict"),
    [
        ("value: residuals.position.p99, at_most_mm: 0.5", "{}", FAILED),
        ("value: residuals.position.p99, at_most_mm: 9, undecided: fail", "{}", FAILED),
        ("value: residuals.position.p99, at_most_mm: 9, undecided: warn", "{}", WARNED),
        ("value: residuals.position.p99, at_most_mm: 9, undecided: pass", "{}", UNDECIDED),
        ("value: data.poses, at_least: 100, on_fail: warn", "{}", WARNED),
        ("value: data.poses, at_least: 99", "{}", PASSED),
        (MEAN, "{mm: 0.5, of: mean}", FAILED),
        (MEAN, "{mm: 5, of: mean}", PASSED),
    ],
)
def test_few_rows_cannot_pass_a_percentile_and_settings_decide_what_follows(
    tmp_path, text, tolerance, verdict
):
    tables = run(tmp_path / "r", vectors(99))
    assert judged(tmp_path, text, tables, tolerance=tolerance).verdict == verdict


@pytest.mark.parametrize(
    ("row", "limit", "verdict", "key"),
    [
        ("{subset: train, fold: null, quantity: position}", "at_most: 0.2", PASSED, "value_mm"),
        ("{subset: train, fold: null, quantity: position}", "at_least: 0.3", FAILED, "value_mm"),
        ("{subset: train, fold: 1}", "at_most: 3.1", FAILED, "value_mrad"),
        ("{subset: train, fold: 0}", "at_most: 3, undecided: warn", WARNED, "value_mm"),
        ("{subset: train}", "at_most: 0.3", FAILED, None),
        ("{subset: test}", "at_most: 0.3", FAILED, None),
        ("{fould: 1}", "at_most: 0.3", FAILED, None),
    ],
)
def test_any_number_of_a_table_is_held_to_a_limit(tmp_path, row, limit, verdict, key):
    residuals = {
        "comparison": "dh_vs_measured",
        "subset": ["train", "validation", "train", "train"],
        "fold": [np.nan, np.nan, 1, 0],
        "quantity": ["position", "position", "orientation", "position"],
        "unit": ["mm", "mm", "mrad", "mm"],
        "mean": [0.2, 0.4, 3.2, np.nan],
    }
    tables = tables_of(tmp_path, residuals=residuals)
    found = judged(tmp_path, f"table: residuals, row: {row}, column: mean, {limit}", tables)
    assert found.verdict == verdict
    assert key is None or key in found.figures


@pytest.mark.parametrize(
    ("errors", "measured_as", "text", "verdict"),
    [
        (1.1 * vectors(200), b"0", f"{SINCE}, allow_mm: 0.02", FAILED),
        (1.02 * vectors(180, 2), b"1", f"{SINCE}, allow_mm: 0", PASSED),
        (vectors(200), b"0", "value: residuals.position.largest, against: accepted, allow_mm: 0",
         PASSED),
        (9.0 * vectors(400, 2), b"1",
         "value: residuals.position.largest, against: accepted, allow_mm: 0.1, undecided: pass",
         UNDECIDED),
    ],
    ids=["worse at the same poses", "perhaps chance", "the same run", "largest of more"],
)  # fmt: skip
def test_a_run_against_the_accepted_one(tmp_path, errors, measured_as, text, verdict):
    accepted = run(tmp_path / "a", vectors(200))
    found = judged(tmp_path, text, run(tmp_path / "r", errors, measured_as), accepted)
    assert (found.verdict, found.kind) == (verdict, "against")
    assert found.figures["paired"] == (measured_as == b"0")
    if verdict == FAILED:
        size = np.linalg.norm(vectors(200), axis=1).mean()
        assert found.figures["worse_by_mm"] == pytest.approx(0.1 * size)
        assert 0.02 < found.figures["worse_by_at_least_mm"] < 0.1 * size


@pytest.mark.parametrize(
    ("text", "verdict", "says"),
    [
        ("claims: agree", FAILED, "differs: two"),
        ("claims: agree, except: [two, one]", PASSED, "agrees, though excepted: one"),
        ("claims: agree, except: [two, map_three]", PASSED, "not comparable: three"),
        ("claims: agree, except: [twoo]", FAILED, "twoo"),
    ],
)
def test_claims_that_differ_fail_unless_excepted_or_used_to_choose(tmp_path, text, verdict, says):
    claims = {
        "claim": ["one", "two", "three", "map_three"],
        "verdict": ["agrees", "differs", "not comparable", "differs"],
        "used_to_choose": [False, False, False, True],
    }
    found = judged(tmp_path, text, tables_of(tmp_path, claims=claims))
    assert found.verdict == verdict
    assert says in found.says
    counts = (("claims", 3), ("agree", 1), ("differ", 1))
    assert all(found.figures.get(name, count) == count for name, count in counts)


@pytest.mark.parametrize(
    ("asked", "accepted", "verdict"),
    [
        ("none", [], PASSED),
        ("none", ["seen and fine"], FAILED),
        ("known", ["seen and fine"], PASSED),
        ("known", ["seen and fine", None], FAILED),
    ],
)
def test_suspicions_are_none_or_known_and_notes_do_not_count(tmp_path, asked, accepted, verdict):
    count = len(accepted)
    check = {
        "finding": ["outliers"] * count + ["few_poses", "left_out"],
        "level": ["warning"] * count + ["note", "note"],
        "what": ["line 3 is far off"] * count + ["there are few", "a column"],
        "accepted": [*accepted, None, None],
    }
    tables = tables_of(tmp_path, measurements={"row": [2.0, 3.0]}, data_check=check)
    found = judged(tmp_path, f"suspicions: {asked}", tables)
    assert found.verdict == verdict
    known = sum(map(bool, accepted))
    assert found.figures == {"suspicions": count, "accepted": known}
    tables["measurements"]["row"] = np.nan
    assert judged(tmp_path, f"suspicions: {asked}", tables).verdict == PASSED


@pytest.mark.parametrize(
    ("verdict", "becomes"),
    [("first", PASSED), ("holds", PASSED), ("recalibrate", FAILED), ("cannot be told", WARNED)],
)
def test_the_newest_line_of_a_history_decides(tmp_path, verdict, becomes):
    names = ("moved_mm", "chance_mm", "beyond_mm", "probability")
    history = {
        "series": ["arm-2026-03-01", "arm-2026-06-02"],
        "date": ["2026-03-01", "2026-06-02"],
        "in_force": [None, "arm-2026-03-01"],
        "joint": [np.nan, 4],
        "verdict": ["recalibrate", verdict],
        "reason": [None, "too few poses"],
        **{name: [np.nan, 0.3 + i] for i, name in enumerate(names)},
    }
    tables = tables_of(tmp_path, history=history)
    found = judged(tmp_path, "history: holds, undecided: warn", tables)
    assert found.verdict == becomes
    assert [*found.figures.values()] == [0.3, 1.3, 2.3, 3.3, 2]
