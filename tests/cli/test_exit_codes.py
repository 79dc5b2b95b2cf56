"""A build server goes by exit codes: each command ends with what the one table says of it."""

from __future__ import annotations

import pytest
from command_line import call

from kinacc.checks.report import CLEAN, SUSPICIOUS
from kinacc.checks.report import UNUSABLE as UNUSABLE_DATA
from kinacc.cli.exit_codes import AGAINST, DONE, UNUSABLE

ROBOT = "datasets: {cell: {robot: mh180, measurements: {source: synthetic}}}\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a configuration, one that cannot be used, and results that are damaged."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.yaml").write_text(ROBOT)
    (tmp_path / "wrong.yaml").write_text("datasets: {cell: {robt: mh180}}\n")
    (tmp_path / "results" / "cell").mkdir(parents=True)
    (tmp_path / "results" / "cell" / "robot.parquet").write_text("no table")
    return tmp_path


def test_codes_of_the_data_check_are_those_of_all_commands():
    assert (CLEAN, SUSPICIOUS, UNUSABLE_DATA) == (DONE, AGAINST, UNUSABLE)


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("check-results results", UNUSABLE),
        ("check-results results --config wrong.yaml", UNUSABLE),
        ("add june.csv --to cell.yaml", UNUSABLE),
        ("summary results", AGAINST),
        ("check-data wrong.yaml", UNUSABLE),
    ],
)
def test_what_a_pipeline_calls_ends_as_the_table_says(here, words, code):
    done = call(*words.split())
    assert done.exit_code == code, done.output
