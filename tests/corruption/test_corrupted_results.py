"""Files of a finished study are harmed or rewritten, and the check of results is asked."""

from __future__ import annotations

import fcntl
import json
import re
import subprocess
import sys
from pathlib import Path

import corruptions
import numpy as np
import pytest
from command_line import call
from corruptions import Case, Study, study

from kinacc.workflow.verification import check, recomputation


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Study:
    folder = tmp_path_factory.mktemp("corrupted")
    study(folder / "older", 5, drawn=())
    return Study(study(folder / "own", 20, "svg", drawn=["mh180"]), folder / "older" / "results")


def configs(finished: Study) -> list[str]:
    own = [corruptions.ROOT / "config.yaml", finished.folder.parent / "small.yaml"]
    return [word for path in own for word in ("--config", str(path))]


@pytest.mark.parametrize("level", ["nothing", "file"])
def test_whatever_happens_to_a_file_is_found_by_its_digest_and_its_record(finished, level):
    cases = finished.cases(15, 3, level)
    assert [case for case in cases if not finished.told(case)] == []


REWRITTEN = [
    ("measurements.parquet", "number by 1 %"),
    ("robot.parquet", "word"),
    ("vec_covariance.parquet", "number tenfold"),
    ("dh_model.parquet", "number tenfold"),
    ("pose_errors.parquet", "number tenfold"),
    ("assessment_points.parquet", "number tenfold"),
    ("study_summary.parquet", "number by 1 %"),
    ("claims.parquet", "word"),
    ("summary.parquet", "word"),
]


@pytest.mark.parametrize(("file", "kind"), REWRITTEN)
def test_a_table_rewritten_with_every_digest_and_record_renewed_is_found(finished, file, kind):
    draws = (Case("mh180", file, kind, draw, "all") for draw in range(9))
    case = next(case for case in draws if finished.corrupted(case) is not None)
    assert finished.told(case)


@pytest.mark.parametrize("turned", [True, False])
def test_undetermined_directions_may_be_any_basis_of_what_they_span(turned):
    """Another processor rounds to another basis, and the numbers mean the same."""
    first, second = np.array([0.6, 0.8, 0.0]), np.array([0.0, 0.0, 1.0])
    right = {
        "quantity": np.array(["rank", *["undetermined_direction"] * 6], dtype=object),
        "number": np.array([np.nan, 1, 1, 1, 2, 2, 2]),
        "parameter": np.array([None, *["a_1", "a_2", "base_z"] * 2], dtype=object),
        "value": np.array([27.0, *first, *second]),
    }
    other = 0.6 * second - 0.8 * first if turned else second
    own = {**right, "value": np.array([27.0, *(0.6 * first + 0.8 * second), *other])}
    assert (list(recomputation._held(Path("dh_fit"), own, right)) == []) is turned


def test_a_rewritten_simulation_is_found_where_all_of_them_are_computed_again(finished):
    case = Case("mh180", "study_chunk/1-of-2.parquet", "number tenfold", 4, "all")
    name = f"{case.dataset}/{case.file}"
    changed = corruptions.renewed(
        finished.folder, finished.files, case.dataset, name, finished.corrupted(case)
    )
    assert f"{case.dataset}/study.parquet" in changed, "what follows from it was to be renewed"
    assert finished.told(case)


def test_the_digest_of_a_run_kept_elsewhere_tells_a_run_of_other_values(finished):
    folder = finished.folder / "mh180"
    done = call("check-results", folder, *configs(finished))
    assert done.exit_code == 0, done.stdout
    (digest,) = re.findall("^digest of all records: ([0-9a-f]{64})$", done.stdout, re.M)
    assert call("check-results", folder, "--expect", digest).exit_code == 0
    other = check.check_results(finished.older / "mh180").digest
    done = call("check-results", folder, "--expect", other)
    assert done.exit_code == 1
    assert f"digest of all records is {digest}; allowed: {other}" in done.stdout


@pytest.mark.parametrize("dataset", ["mh180", "own"])
def test_every_table_of_a_study_is_computed_again(finished, dataset):
    told = check.check_dataset(finished.folder / dataset, finished.plan)
    tables = {Path(each) for each in told.checked if each.endswith(".parquet")}
    assert set(told.again) == {p.parent.name if "-of-" in p.stem else p.stem for p in tables}


def test_a_check_beside_a_run_that_is_at_work_says_so_in_one_line(finished):
    with (finished.folder / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        lock.write(json.dumps({"command": "snakemake -c2", "process": 12, "host": "here"}))
        lock.flush()
        words = [sys.executable, "-m", "kinacc", "check-results", str(finished.folder)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    (finished.folder / ".lock").unlink()
    assert done.returncode != 0
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert "another run is at work in it: snakemake -c2 (process 12 on here)" in line
