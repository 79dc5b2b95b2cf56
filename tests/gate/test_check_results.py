"""``kinacc check-results``: files, thresholds, accepted runs, and what a build server gets."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command_line import answer, call
from held_out_errors import held_out_mm
from stages_by_hand import run_stages
from whole_project import finished

from kinacc.tables import store, sums

__all__ = ["finished"]

SMALL = """\
datasets: {mh180: {robot: mh180}}
measurements: {folds: 4, synthetic: {poses: %d, tracker_noise_mm: %s}}
calibration: {vec: {order: 1}}
seed: %d
"""
STAGES = ("measurements", "vec", "dh", "residuals", "summary")
# Results of weeks: poses, noise in mm, seed.
WEEKS = {"first": (90, 0.05, 1), "next": (90, 0.051, 2),
         "noisy": (90, 1.0, 3), "few": (18, 0.05, 5)}  # fmt: skip


def rewritten(path: Path, table: pa.Table) -> None:
    """Write another table in place of one, and its digest in place of the old one's."""
    old = sums.digest(path.read_bytes())
    path.write_bytes(store.content_of(table))
    for listed in (path.parent / sums.FOLDER).iterdir():
        text = listed.read_text().replace(old, sums.digest(path.read_bytes()))
        listed.write_text(text)


def column_set(path: Path, name: str, values, **metadata: str) -> None:
    table = pq.read_table(path)
    field = table.schema.field(name)
    changed = {key.encode(): value for key, value in metadata.items()}
    field = field.with_metadata({**field.metadata, **changed}).with_nullable(True)
    place = table.schema.get_field_index(name)
    rewritten(path, table.set_column(place, field, [pa.array(values, field.type)]))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    found = {}
    for name, week in WEEKS.items():
        base = tmp_path_factory.mktemp(name)
        (base / "small.yaml").write_text(SMALL % week)
        found[name] = base / "results"
        run_stages(STAGES, [base / "small.yaml"], found[name])
    return found


@pytest.fixture
def here(made, tmp_path, monkeypatch):
    """A folder with a copy of the first week's results, called from."""
    shutil.copytree(made["first"], tmp_path / "results")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def told(*words, code=0):
    """Outcomes by name, as the command prints them in JSON."""
    report = answer("check-results", *words, code=code)
    assert (report["schema_version"], report["passed"]) == (1, code == 0)
    return {each["name"]: each for each in report["outcomes"]}


def test_results_of_other_settings_than_the_configuration_has_are_noticed(here):
    for week, verdict in (("first", "passed"), ("next", "warned")):
        Path("config.yaml").write_text(SMALL % WEEKS[week])
        found = told("results")["files"]
        assert (found["verdict"], "summary.parquet" in found["says"]) == (
            verdict,
            verdict == "warned",
        )


def _edited(path):
    pq.write_table(pq.read_table(path).slice(1), path)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (_edited, "rm results/mh180/dh_model.parquet"),
        (lambda path: path.unlink(), "missing"),
        (lambda path: path.rename(path.with_name("claims.parquet")), "claims.parquet"),
        (lambda path: column_set(path, "d_mm", [None] * 6), "null or NaN in rows 0, 1, 2, 3, 4"),
        (lambda path: column_set(path, "d_mm", [np.inf] + [0.0] * 5), "infinite in row 0"),
        (lambda path: column_set(path, "joint", [1, 2, 3, 4, 5, 5]), "same key in rows 4, 5"),
        (lambda path: column_set(path, "joint", [1, 2, 3, 4, 5, -6]), "-6 in row 5"),
        (lambda path: column_set(path, "d_mm", [0.0] * 6, unit="m"), "unit or meaning: d_mm"),
        (lambda path: rewritten(path, pq.read_table(path).drop(["a_mm"])), "column a_mm: missing"),
        (
            lambda path: rewritten(path, pq.read_table(path).replace_schema_metadata({})),
            "provenance",
        ),
        (
            lambda path: rewritten(
                path,
                pq.read_table(path).replace_schema_metadata(
                    dict.fromkeys(pq.read_schema(path).metadata, "")
                ),
            ),
            "schema metadata",
        ),
    ],
)
def test_a_table_that_is_not_as_its_stage_and_schema_have_it_fails(here, spoil, says):
    spoil(Path("results/mh180/dh_model.parquet"))
    found = told("results", code=1)["files"]
    assert found["verdict"] == "failed"
    assert says in found["says"]


def test_reports_for_machines_can_be_read_by_them(here):
    names = ["check.json", "check.xml", "check.md"]
    words = [word for name in names for word in ("--out", name)]
    Path("config.yaml").write_text(
        SMALL % WEEKS["first"]
        + "gates: [{name: 'a <b> & \"c\"', value: residuals.position.mean, at_most_mm: 1e-4}]\n"
    )
    call("check-results", *words, code=1)
    assert json.loads(Path("check.json").read_text())["passed"] is False
    (suite,) = ElementTree.parse("check.xml").getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("skipped")) == ("2", "1", "0")
    assert [case.get("name") for case in suite] == ["files", 'a <b> & "c"']
    assert suite[1].find("failure") is not None
    assert r"| failed | mh180 | a \<b\> & " in Path("check.md").read_text()


@pytest.mark.parametrize(
    ("now", "before", "code", "result"),
    [("next", "first", 0, "same"), ("noisy", "first", 1, "worse"), ("first", "noisy", 0, "better"),
     ("few", "first", 0, "undecided")],
)  # fmt: skip
def test_new_measurements_are_better_the_same_worse_or_undecided(made, now, before, code, result):
    found = told(made[now], "--against", made[before], code=code)["held-out errors"]["figures"]
    assert found["result"] == result
    errors = [held_out_mm(made[name] / "mh180") for name in (now, before)]
    means = [np.linalg.norm(each, axis=1).mean() for each in errors]
    told_means = found["mean_mm"], found["accepted_mean_mm"]
    assert told_means == pytest.approx(means, rel=1e-9)
    assert found["difference_mm"] == pytest.approx(means[0] - means[1])


def test_a_knocked_joint_makes_the_accepted_calibration_hold_no_more(made, tmp_path):
    """A fit takes up what the joint does: held-out errors are the same."""
    config, results = tmp_path / "small.yaml", tmp_path / "results"
    config.write_text(SMALL % WEEKS["next"])
    run_stages(STAGES[:1], [config], results)
    path = results / "mh180" / "measurements.parquet"
    column_set(path, "q4", pq.read_table(path)["q4"].to_numpy() + 2e-3)
    run_stages(STAGES[1:], [config], results)
    found = told(results, "--against", made["first"], code=1)
    assert found["held-out errors"]["figures"]["result"] == "same"
    assert found["arm"]["verdict"] == "failed"
    assert found["arm"]["figures"]["moved_mm"] > 0.1
    unchanged = told(made["next"], "--against", made["first"])
    assert unchanged["arm"]["verdict"] == "passed"


def test_a_run_is_accepted_for_a_reason_and_later_runs_are_compared_with_it(here):
    accept = ("check-results", "results", "--accept", "accepted")
    call(*accept, code=2)
    assert not Path("accepted").exists()
    call(*accept, "--reason", "after the new tracker", code=0)
    (note,) = json.loads(Path("accepted/accepted.json").read_text())
    assert (note["reason"], note["datasets"]) == ("after the new tracker", ["mh180"])
    for path in Path("results/mh180").glob("*.parquet"):
        assert (Path("accepted/mh180") / path.name).read_bytes() == path.read_bytes()
    assert told("results", "--against", "accepted")["accepted run"]["verdict"] == "passed"
    call(*accept, "--reason", "a second time", code=0)
    assert len(json.loads(Path("accepted/accepted.json").read_text())) == 2


def test_a_bit_turned_in_any_file_is_found(finished, tmp_path):
    folder = tmp_path / "results" / "own"
    shutil.copytree(finished.folder / "results" / "own", folder)
    draw = np.random.default_rng(60)

    def turned(path: Path) -> bytes:
        good = path.read_bytes()
        place, bit = int(draw.integers(len(good))), 1 << int(draw.integers(8))
        path.write_bytes(good[:place] + bytes([good[place] ^ bit]) + good[place + 1 :])
        return good

    call("check-results", folder, code=0)
    made = [path for path in folder.rglob("*.*") if path.suffix in (".parquet", ".svg", ".html")]
    good = {path: turned(path) for path in made}
    assert {Path(problem.where) for problem in sums.changed(folder)} == {*made}
    call("check-results", folder, code=1)
    for path, content in good.items():
        path.write_bytes(content)
    lists = [*folder.rglob("*.sha256"), folder / "SHA256SUMS"]
    for path in draw.choice(np.array(lists, object), 5):
        content = turned(path)
        assert call("check-results", folder).exit_code in (1, 2), path
        path.write_bytes(content)
