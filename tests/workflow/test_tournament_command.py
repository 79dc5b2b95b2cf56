"""The tournament as a command: resumed where it stopped, the same whatever the parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from recorded import write

from kinacc.artifacts import store
from kinacc.artifacts.store import read
from kinacc.cli.group import main
from kinacc.study.tournament import contest, fields
from kinacc.workflow.verification.check import check_results

TINY = contest.Size((0.1, 0.3), {20: (10, 30)}, 2, 1, (0,))
MARKS = {"kinacc_version": "0", "config_hash": "", "code_hash": "", "inputs_hash": "", "seed": 1}
ASSESSORS = ("--assessor", "maximum", "--assessor", "single_shot")


@pytest.fixture
def results(tmp_path, monkeypatch) -> Path:
    """A results folder with the points of the paper's arm, and a tournament of seconds."""
    monkeypatch.setitem(contest.SIZES, "default", TINY)
    monkeypatch.setattr(fields, "FAMILIES", {"smooth": fields.FAMILIES["smooth"]})
    rng = np.random.default_rng(2)
    error = 0.3 * rng.normal(size=(25, 3))
    points = {"point": np.arange(25)}
    points |= {f"q{j}": rng.uniform(-0.5, 0.5, 25) for j in range(1, 7)}
    points |= {f"s{j}": np.zeros(25) for j in range(1, 7)}
    points |= {f"e{axis}_mm": error[:, i] for i, axis in enumerate("xyz")}
    points["true_error_mm"] = np.linalg.norm(error, axis=1)
    path = tmp_path / "mh180" / "assessment_points.parquet"
    write(path, "assessment_points", points, MARKS)
    return tmp_path


def run(results: Path, *more: str):
    given = ["tournament", "--results", str(results), *ASSESSORS, *more]
    return CliRunner().invoke(main, given, catch_exceptions=False)


def left(results: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (results / "tournament").glob("*.parquet")}


def test_the_number_of_parts_leaves_the_same_bytes(results):
    assert run(results, "--parts", "1").exit_code == 0
    one = left(results)
    assert set(one) == {f"tournament_{each}.parquet" for each in ("cells", "verdicts", "fields")}
    assert run(results, "--parts", "3").exit_code == 0
    assert left(results) == one
    cells = read(results / "tournament" / "tournament_cells.parquet")
    assert set(cells["field"]) == {"mh180", "smooth_0"}
    assert len(cells["field"]) == 2 * 2 * 2 * (1 + 2)


def test_a_stopped_tournament_goes_on_where_it_was(results):
    assert run(results, "--parts", "3", "--part", "2-of-3").exit_code == 0
    done = results / "tournament" / "tournament_chunk" / "2-of-3.parquet"
    before = done.stat().st_mtime_ns
    said = run(results, "--parts", "3")
    assert "1 of 3 parts are there" in said.output
    assert done.stat().st_mtime_ns == before


def test_verdicts_are_told_to_machines_with_times_on_request(results):
    import json

    given = ["tournament", "--results", str(results), *ASSESSORS, "--json", "--times"]
    said = json.loads(CliRunner().invoke(main, given).stdout)
    assert {row["assessor"] for row in said["verdicts"]} == {"single_shot"}
    assert set(said["time_ms"]) == {"maximum", "single_shot"}


def test_statements_whose_assumption_is_untrue_are_told_apart(results, monkeypatch):
    verdict = {"assessor": "search_and_confirm", "target": "candidates", "cells": 2, "rejected": 1,
               "statements": 50, "below": 1, "worst_holds": 0.9, "mean_holds": 0.98,
               "withheld": 0.125, "setup": "plain", "world": "stated"}  # fmt: skip
    cells = {
        "assessor": ["search_and_confirm"] * 3 + ["single_shot"],
        "target": ["candidates", "candidates", "measured", "candidates"],
        "broken": [7, 0, 9, 5],
        "broken_holds": [5 / 7, np.nan, 1.0, 1.0],
        "setup": ["plain"] * 4,
        "world": ["stated"] * 4,
    }
    tables = {
        "tournament_verdicts": {name: np.array([value]) for name, value in verdict.items()},
        "tournament_cells": {name: np.array(column) for name, column in cells.items()},
    }
    monkeypatch.setattr(store, "read", lambda path: tables.get(Path(path).stem) or read(path))
    head, row, *_ = run(results, "--parts", "1").stdout.splitlines()
    assert row.split() == ["search_and_confirm", "candidates", "50", "0.980", "0.900", "1", "1",
                           "2", "12.5%", "7", "0.714"]  # fmt: skip
    assert head.endswith("rejected  below  cells  no statement  assumption broken  held so")
    assert len(head) == len(row)


def test_noise_that_the_size_does_not_have_is_refused(results):
    said = run(results, "--noise-mm", "0.1", "--parts", "1")
    assert said.exit_code == 0
    cells = read(results / "tournament" / "tournament_cells.parquet")
    assert set(cells["noise_mm"]) == {0.1}
    said = run(results, "--noise-mm", "0.7")
    assert said.exit_code == 2
    assert "0.1, 0.3" in said.stderr


def test_results_of_a_tournament_are_checked(results):
    run(results, "--parts", "2")
    folder = results / "tournament"
    assert check_results(folder).ok
    (folder / "tournament_verdicts.parquet").unlink()
    assert [problem.what for problem in check_results(folder).datasets[0].problems] == ["missing"]


@pytest.mark.parametrize("where", ["tournament_chunk/1-of-2", "tournament_verdicts"])
def test_a_damaged_tournament_is_mended_by_running_it_again(results, where):
    run(results, "--parts", "2")
    before, folder = left(results), results / "tournament"
    path = folder / f"{where}.parquet"
    content = bytearray(path.read_bytes())
    content[8:60] = bytes(52)  # its provenance, at the end, stays readable
    path.write_bytes(content)
    found = check_results(folder)
    assert not found.ok
    assert "kinacc tournament" in str(found)
    assert run(results, "--parts", "2").exit_code == 0
    assert check_results(folder).ok
    assert left(results) == before


def test_everything_wrong_is_said(results):
    (results / "mh180" / "assessment_points.parquet").unlink()
    said = run(results)
    assert said.exit_code == 2
    assert "no such file" in said.output
    given = ["tournament", "--results", str(results), "--assessor", "guess", "--assessor", "luck"]
    said = CliRunner().invoke(main, given)
    assert "guess" in said.output
    assert "luck" in said.output
