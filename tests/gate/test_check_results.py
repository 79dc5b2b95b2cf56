"""``kinacc check-results``: what a build server is told of results, and what it finds in them."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyarrow.parquet as pq
import pytest
from command_line import call
from stages_by_hand import perform
from whole_project import finished

from kinacc.gate.accepted import compared
from kinacc.tables import store

__all__ = ["finished"]

SMALL = """\
datasets: {mh180: {robot: mh180}}
measurements: {folds: 4, synthetic: {poses: 90, tracker_noise_mm: %s}}
calibration: {vec: {order: 1}}
seed: %d
"""


def calibrated(base: Path, noise_mm: float = 0.05, seed: int = 1) -> Path:
    """Results of a synthetic arm, measured so well in one week."""
    base.mkdir(parents=True, exist_ok=True)
    config = base / "small.yaml"
    config.write_text(SMALL % (noise_mm, seed))
    for stage in ("measurements", "vec", "dh", "residuals", "summary"):
        perform(stage, [str(config)], base / "results")
    return base / "results"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Results of four weeks: the first, two like it, one measured badly."""
    base = tmp_path_factory.mktemp("weeks")
    weeks = {"first": (0.05, 1), "again": (0.05, 1), "next": (0.05, 2), "noisy": (1.0, 3)}
    return {name: calibrated(base / name, *week) for name, week in weeks.items()}


@pytest.fixture
def here(made, tmp_path, monkeypatch):
    """A folder with a copy of the first week's results, called from."""
    shutil.copytree(made["first"], tmp_path / "results")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def told(*words, code=0):
    """What the command says in JSON: outcomes by name."""
    done = call("check-results", *words, "--json")
    assert done.exit_code == code, done.output
    return {each["name"]: each for each in json.loads(done.stdout)["outcomes"]}


def test_results_as_the_stages_left_them_pass(here):
    done = call("check-results")
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("PASS: ")
    report = json.loads(call("check-results", "results", "--json").stdout)
    assert report["schema_version"] == 1
    assert report["passed"] is True
    assert [each["verdict"] for each in report["outcomes"]] == ["passed"]


def test_one_data_set_named_as_a_folder_is_checked(here):
    assert [each["dataset"] for each in told("results/mh180").values()] == ["mh180"]


@pytest.mark.parametrize(
    "words", [("nowhere",), ("results", "--config", "nowhere.yaml"), ("results", "--out", "a.doc")]
)
def test_what_cannot_be_used_ends_with_2_and_no_traceback(here, words):
    done = call("check-results", *words)
    assert done.exit_code == 2
    assert words[-1].partition(".")[0] in done.output
    assert "Traceback" not in done.output


def test_a_number_edited_in_a_table_is_found(here):
    path = Path("results/mh180/dh_model.parquet")
    table = pq.read_table(path)
    place = table.schema.get_field_index("d_mm")
    edited = table.column("d_mm").to_numpy() + 1.0
    pq.write_table(table.set_column(place, table.schema.field("d_mm"), [edited]), path)
    found = told("results", code=1)["files"]
    assert found["verdict"] == "failed"
    assert "dh_model.parquet" in found["says"]
    assert f"rm {path}" in found["says"]


def test_a_table_that_is_missing_and_one_that_nobody_made_are_found(here):
    folder = Path("results/mh180")
    (folder / "frames.parquet").rename(folder / "claims.parquet")
    says = told("results", code=1)["files"]["says"]
    assert "frames.parquet" in says
    assert "claims.parquet" in says


@pytest.mark.parametrize(("limit_mm", "code", "verdict"), [(50, 0, "passed"), (1e-4, 1, "failed")])
def test_a_threshold_of_the_configuration_is_held(here, limit_mm, code, verdict):
    Path("limits.yaml").write_text(
        "datasets: {mh180: {robot: mh180}}\n"
        f"gates: [{{name: mean, value: residuals.position.mean, at_most_mm: {limit_mm}}}]\n"
    )
    found = told("results", "--config", "limits.yaml", code=code)["mean"]
    assert found["verdict"] == verdict
    assert found["figures"]["at_most_mm"] == limit_mm
    errors = store.read("results/mh180/pose_errors.parquet")
    model = found["figures"]["model"]
    own = (errors["comparison"] == f"{model}_vs_measured") & (
        errors["estimate"] == "cross_validated"
    )
    sizes = np.linalg.norm([errors[f"e{axis}_mm"][own] for axis in "xyz"], axis=0)
    assert found["figures"]["value_mm"] == pytest.approx(sizes.mean(), rel=1e-9)


@pytest.mark.parametrize(
    ("asked", "code", "verdict"),
    [("fail", 1, "failed"), ("warn", 0, "warned"), ("pass", 0, "undecided")],
)
def test_what_the_data_do_not_decide_is_what_the_configuration_says(here, asked, code, verdict):
    gate = f"{{name: tail, value: residuals.position.p99, at_most_mm: 50, undecided: {asked}}}"
    Path("config.yaml").write_text(f"datasets: {{mh180: {{robot: mh180}}}}\ngates: [{gate}]\n")
    found = told("results", code=code)["tail"]  # 90 rows are too few to tell of 1 % of them
    assert found["verdict"] == verdict


def test_reports_for_machines_can_be_read_by_them(here):
    names = ["check.json", "metrics.json", "check.xml", "check.md", "check.txt"]
    words = [word for name in names for word in ("--out", name)]
    Path("config.yaml").write_text(
        "datasets: {mh180: {robot: mh180}}\n"
        "gates: [{name: 'a <b> & \"c\"', value: residuals.position.mean, at_most_mm: 1e-4}]\n"
    )
    assert call("check-results", *words).exit_code == 1
    assert json.loads(Path("check.json").read_text())["passed"] is False
    metrics = json.loads(Path("metrics.json").read_text())
    assert all(isinstance(value, (int, float)) for value in metrics.values())
    assert metrics['mh180/a <b> & "c"/at_most_mm'] == 1e-4
    (suite,) = ElementTree.parse("check.xml").getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    assert [case.get("name") for case in suite] == ["files", 'a <b> & "c"']
    assert suite[1].find("failure") is not None
    assert Path("check.md").read_text().startswith("## FAIL")
    assert Path("check.txt").read_text().startswith("FAIL")


def test_the_same_run_passes_against_itself_made_again(here, made):
    assert told("results", "--against", made["again"])["accepted run"]["verdict"] == "passed"


def test_other_numbers_from_the_same_measurements_fail(here, made):
    shutil.copytree(made["again"], "other")
    config = made["again"].parent / "other.yaml"
    config.write_text((SMALL % (0.05, 1)).replace("{vec:", "{dh: {truncation: 0.1}, vec:"))
    for stage in ("dh", "residuals", "summary"):
        perform(stage, [str(config)], Path("other"))
    found = told("other", "--against", "results", code=1)["accepted run"]
    assert found["verdict"] == "failed"
    assert found["figures"]["columns"] > 0
    assert "dh_covariance" in found["says"]


@pytest.mark.parametrize(
    ("now", "before", "code", "result"),
    [("next", "first", 0, "same"), ("noisy", "first", 1, "worse"), ("first", "noisy", 0, "better")],
)
def test_new_measurements_are_better_the_same_or_worse(made, now, before, code, result):
    found = told(made[now], "--against", made[before], code=code)["held-out errors"]
    assert found["figures"]["result"] == result
    assert found["figures"]["confidence"] == 0.99
    means = []
    for name in (now, before):
        errors = store.read(made[name] / "mh180" / "pose_errors.parquet")
        chosen = store.read(made[name] / "mh180" / "model_selection.parquet")
        model = chosen["model"][np.asarray(chosen["selected"]) == 1][0]
        own = (errors["comparison"] == f"{model}_vs_measured") & (
            errors["estimate"] == "cross_validated"
        )
        sizes = np.linalg.norm([errors[f"e{axis}_mm"][own] for axis in "xyz"], axis=0)
        means.append(sizes.mean())
    told_means = found["figures"]["mean_mm"], found["figures"]["accepted_mean_mm"]
    assert told_means == pytest.approx(means, rel=1e-9)


def test_too_few_poses_decide_nothing(made, tmp_path):
    config = tmp_path / "few.yaml"
    config.write_text((SMALL % (0.05, 5)).replace("poses: 90", "poses: 18"))
    for stage in ("measurements", "vec", "dh", "residuals", "summary"):
        perform(stage, [str(config)], tmp_path / "few")
    found = told(tmp_path / "few", "--against", made["first"])["held-out errors"]
    assert found["verdict"] == "undecided"


def test_a_knocked_joint_makes_the_accepted_calibration_hold_no_more(made, tmp_path):
    """A fit takes up what the joint does: held-out errors are the same."""
    config, now = tmp_path / "small.yaml", tmp_path / "results" / "mh180"
    config.write_text(SMALL % (0.05, 2))
    perform("measurements", [str(config)], tmp_path / "results")
    columns = store.read(now / "measurements.parquet")
    columns["q4"] = columns["q4"] + 2e-3
    marks = store.read_metadata(now / "measurements.parquet")
    store.write(now / "measurements.parquet", "measurements", columns, marks)
    for stage in ("vec", "dh", "residuals"):
        perform(stage, [str(config)], tmp_path / "results")
    found = {each.name: each for each in compared(now, made["first"] / "mh180", 500.0)}
    assert found["held-out errors"].figures["result"] == "same"
    assert found["arm"].verdict == "failed"
    assert found["arm"].figures["moved_mm"] > found["arm"].figures["chance_mm"]
    unchanged = {
        each.name: each for each in compared(made["next"] / "mh180", made["first"] / "mh180", 500.0)
    }
    assert unchanged["arm"].verdict == "passed"


def test_a_joint_that_moved_is_named(made, here):
    shutil.copytree(made["next"], "moved")
    folder = Path("moved/mh180")
    columns = store.read(folder / "dh_model.parquet")
    joint = int(np.flatnonzero(columns["joint"] == 4)[0])
    std = columns["std_theta_offset_rad"][joint]
    columns["theta_offset_rad"] = columns["theta_offset_rad"].copy()
    columns["theta_offset_rad"][joint] += 50.0 * std
    store.write(folder / "dh_model.parquet", "dh_model", columns,
                store.read_metadata(folder / "dh_model.parquet"))  # fmt: skip
    lists = folder / "sums" / "dh.sha256"
    old = store.sums.digest((made["next"] / "mh180" / "dh_model.parquet").read_bytes())
    new = store.sums.digest((folder / "dh_model.parquet").read_bytes())
    lists.write_text(lists.read_text().replace(old, new))
    found = told("moved", "--against", "results")["parameters"]
    assert found["verdict"] == "warned"
    assert "theta_offset of joint 4" in found["says"]


def test_a_run_is_accepted_for_a_reason_and_is_what_later_runs_are_held_to(here):
    assert call("check-results", "results", "--accept", "accepted").exit_code == 2
    assert not Path("accepted").exists()
    reason = "after the new tracker"
    done = call("check-results", "results", "--accept", "accepted", "--reason", reason)
    assert done.exit_code == 0, done.output
    (note,) = json.loads(Path("accepted/accepted.json").read_text())
    assert (note["reason"], note["datasets"]) == (reason, ["mh180"])
    for path in Path("results/mh180").glob("*.parquet"):
        assert (Path("accepted/mh180") / path.name).read_bytes() == path.read_bytes()
    assert told("results", "--against", "accepted")["accepted run"]["verdict"] == "passed"
    again = call("check-results", "results", "--accept", "accepted", "--reason", "a second time")
    assert again.exit_code == 0
    assert len(json.loads(Path("accepted/accepted.json").read_text())) == 2


def test_what_fails_is_not_accepted_and_no_other_folder_is_overwritten(here):
    Path("mine").mkdir()
    Path("mine/thesis.tex").write_text("years of work")
    words = ("--accept", "mine", "--reason", "why not")
    assert call("check-results", "results", *words).exit_code == 2
    assert os.listdir("mine") == ["thesis.tex"]
    Path("results/mh180/frames.parquet").write_bytes(b"PAR1")
    words = ("--accept", "accepted", "--reason", "why not")
    assert call("check-results", "results", *words).exit_code == 1
    assert not Path("accepted").exists()


def test_against_a_run_without_the_data_set_fails(here):
    Path("empty").mkdir()
    found = told("results", "--against", "empty", code=1)["accepted run"]
    assert found["verdict"] == "failed"


def test_sixty_files_with_one_bit_turned_are_all_found(finished, tmp_path):
    results = tmp_path / "results"
    shutil.copytree(finished.folder / "results", results)
    assert call("check-results", results).exit_code == 0
    files = sorted(
        path for path in results.rglob("*")
        if path.suffix in (".parquet", ".svg", ".html", ".sha256") or path.name == "SHA256SUMS"
    )  # fmt: skip
    draw = np.random.default_rng(60)
    passed = []
    for path in draw.choice(np.array(files, object), 60):
        good = path.read_bytes()
        place, bit = int(draw.integers(len(good))), 1 << int(draw.integers(8))
        path.write_bytes(good[:place] + bytes([good[place] ^ bit]) + good[place + 1 :])
        done = call("check-results", results / path.relative_to(results).parts[0])
        if done.exit_code not in (1, 2):
            passed.append((path.name, place, bit, done.output))
        path.write_bytes(good)
    assert passed == []
