"""A person makes a run the accepted one; a pipeline does not, and nothing is left in between."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import call
from runs_by_hand import Run

from kinacc.errors import InputError
from kinacc.gate import accepted
from kinacc.gate.golden import compared
from kinacc.gate.outcome import FAILED, PASSED
from kinacc.workflow.results_lock import RUN

WORDS = {"reason": "looked through", "date": "2026-11-22T10:00:00+00:00", "by": "J. Weber"}


@pytest.fixture(autouse=True)
def at_a_desk(monkeypatch):
    """No build server is at work, though one may run these tests."""
    for name in (*accepted.BUILD_SERVERS, RUN):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def results(tmp_path) -> Path:
    return Run().write(tmp_path / "results")


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_an_accepted_run_holds_tables_and_records_and_says_who_and_why(results, tmp_path):
    (results / "arm" / "logs").mkdir()
    (results / "arm" / "logs" / "dh.log").write_text("")
    (results / "arm" / "report.html").write_text("")
    note = accepted.accept(results, tmp_path / "accepted", WORDS)
    there = files(tmp_path / "accepted")
    assert "arm/dh_model.parquet" in there
    assert "arm/study_chunk/2-of-2.parquet" in there
    assert "arm/records/dh.json" in there
    assert not [name for name in there if "log" in name or "html" in name]
    told = json.loads(there["accepted.json"])
    assert told.items() >= {**WORDS, "datasets": ["arm"], "digest": note.last.digest}.items()
    assert accepted.read(tmp_path / "accepted") == note
    assert compared(results, tmp_path / "accepted")[0].verdict == PASSED


def test_what_was_accepted_before_is_named_by_digest_and_reason(results, tmp_path):
    first = accepted.accept(results, tmp_path / "accepted", WORDS)
    replace(Run(), data="june").write(results)
    second = accepted.accept(results, tmp_path / "accepted", {**WORDS, "reason": "new data"})
    assert [each.digest for each in second.before] == [first.last.digest]
    assert [each.reason for each in second.before] == ["looked through"]
    assert second.last.digest != first.last.digest
    assert not list(tmp_path.glob(".accepted*"))


def test_one_data_set_alone_leaves_the_others_as_they_were_accepted(results, tmp_path):
    shutil.copytree(results / "arm", results / "other")
    accepted.accept(results, tmp_path / "accepted", WORDS)
    before = files(tmp_path / "accepted" / "other")
    replace(Run(), data="june").write(results)
    shutil.rmtree(results / "other")
    note = accepted.accept(results, tmp_path / "accepted", WORDS, ["arm"])
    assert note.last.datasets == ("arm", "other")
    assert files(tmp_path / "accepted" / "other") == before
    assert compared(results, tmp_path / "accepted", ["arm"])[0].verdict == PASSED


def test_everything_that_speaks_against_it_is_said_at_once_and_nothing_changes(
    results, tmp_path, monkeypatch
):
    monkeypatch.setenv("GITLAB_CI", "true")
    monkeypatch.setenv(RUN, "12 results")
    (results / "arm" / "dh_model.parquet").write_bytes(b"edited")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    done = call("accept", results, "--reason", " ", "--dataset", "b", "--to", tmp_path / "mine")
    assert done.exit_code == 2
    assert "Nothing was accepted" in done.output
    for words in ("GITLAB_CI", RUN, "--reason: is empty", "b is none of", "holds no accepted run"):
        assert words in done.output, words
    assert files(tmp_path / "mine") == {"letter.txt": b"dear"}


def test_the_folder_of_one_data_set_is_named_by_an_option(results, tmp_path):
    with pytest.raises(InputError, match=r"give .*results and --dataset arm"):
        accepted.accept(results / "arm", tmp_path / "accepted", WORDS)


def test_results_that_do_not_hold_are_not_accepted(results, tmp_path):
    (results / "arm" / "dh_model.parquet").write_bytes(b"edited")
    done = call("accept", results, "--reason", "fine", "--to", tmp_path / "accepted")
    assert done.exit_code == 2
    assert "dh_model.parquet" in done.output
    assert not (tmp_path / "accepted").exists()


def test_a_record_that_tells_other_settings_than_its_mark_is_not_accepted(results, tmp_path):
    place = results / "arm" / "records" / "dh.json"
    place.write_text(place.read_text().replace('"truncation": 0.01', '"truncation": 0.1'))
    done = call("accept", results, "--reason", "fine", "--to", tmp_path / "accepted")
    assert done.exit_code == 2
    assert "dh.json: config_hash is not that of what it tells" in done.output


@pytest.mark.parametrize("to", ["results", "results/arm", "."])
def test_an_accepted_run_stands_beside_the_results(results, tmp_path, monkeypatch, to):
    monkeypatch.chdir(tmp_path)
    before = files(tmp_path)
    with pytest.raises(InputError, match="one in the other"):
        accepted.accept(Path("results"), Path(to), WORDS)
    assert files(tmp_path) == before


@pytest.mark.parametrize("at", [1, 2])
def test_a_machine_that_refuses_leaves_what_was_accepted(results, tmp_path, monkeypatch, at):
    accepted.accept(results, tmp_path / "accepted", WORDS)
    before = files(tmp_path / "accepted")
    replace(Run(), data="june").write(results)
    rename, calls = os.rename, []

    def refusing(source, target):
        calls.append(source)
        if len(calls) == at:
            raise OSError(28, "No space left on device")
        rename(source, target)

    monkeypatch.setattr(os, "rename", refusing)
    with pytest.raises(OSError, match="No space"):
        accepted.accept(results, tmp_path / "accepted", WORDS)
    monkeypatch.undo()
    assert files(tmp_path / "accepted") == before
    assert not list(tmp_path.glob(".accepted*"))


def test_a_run_that_was_stopped_between_is_found_beside(results, tmp_path):
    accepted.accept(results, tmp_path / "accepted", WORDS)
    (tmp_path / "accepted").rename(tmp_path / ".accepted.host.1.ab.before")
    with pytest.raises(InputError, match=r"mv .*\.accepted\.host\.1\.ab\.before"):
        compared(results, tmp_path / "accepted")


def test_a_record_changed_after_it_was_accepted_is_found_by_the_digest(results, tmp_path):
    accepted.accept(results, tmp_path / "accepted", WORDS)
    shutil.rmtree(tmp_path / "accepted" / "arm")
    replace(Run(), data="june").write(tmp_path / "accepted")
    with pytest.raises(InputError, match="is not as it was accepted"):
        compared(results, tmp_path / "accepted")


@pytest.mark.parametrize(
    "content", [b"", b"{}", b"[]", b"\xff", b'{"format": "kinacc accepted 9"}']
)
def test_a_note_that_is_none_is_said_to_be_none(results, tmp_path, content):
    accepted.accept(results, tmp_path / "accepted", WORDS)
    (tmp_path / "accepted" / "accepted.json").write_bytes(content)
    with pytest.raises(InputError, match="is no note of an accepted run"):
        compared(results, tmp_path / "accepted")


def test_results_of_another_folder_serve_to_compare_without_a_note(results, tmp_path):
    shutil.copytree(results, tmp_path / "before")
    replace(Run(), data="june").with_table("residuals", n=[5, 6]).write(results)
    assert compared(results, tmp_path / "before")[0].verdict == FAILED
