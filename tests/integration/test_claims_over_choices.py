"""The claims over the paper's open choices, as one asks for them: stopped, split, and checked."""

from __future__ import annotations

import pyarrow.parquet as pq
import pytest

TABLES = ("choices", "choices_factors", "claim_shares", "claim_reasons")
FEW = """\
robustness: {draws: 1}
choices: {names: [search, wrist], runs: 2, chunks: 3}
"""


@pytest.fixture(scope="module")
def asked_once(finished, tmp_path_factory):
    """The small study with its choices asked for; never changed."""
    project = finished.copied(tmp_path_factory.mktemp("choices") / "a project")
    project.configure(FEW)
    project.snakemake("choices")
    return project


@pytest.fixture
def asked(asked_once, tmp_path):
    return asked_once.copied(tmp_path / "a project")


def made(project) -> dict[str, bytes]:
    folder = project.folder / "results" / "mh180"
    return {name: (folder / f"{name}.parquet").read_bytes() for name in TABLES}


def test_a_run_that_was_stopped_goes_on_and_other_parts_leave_the_same_bytes(asked):
    before = made(asked)
    folder = asked.folder / "results" / "mh180"
    assert (folder / "figures" / "claims_over_choices.svg").is_file()
    for name in (*TABLES, "choices_chunk/2-of-3", "choices_factors_chunk/2-of-3"):
        (folder / f"{name}.parquet").unlink()
    told = asked.snakemake("choices")
    assert "part 2-of-3" in told
    assert "part 1-of-3" not in told
    assert "part 3-of-3" not in told
    assert made(asked) == before
    asked.configure("choices: {chunks: 1}")
    asked.snakemake("choices")
    assert made(asked) == before


def test_the_check_finds_a_share_that_the_runs_do_not_give(asked):
    assert "all is well" in asked.kinacc("check-results", "results")
    path = asked.folder / "results" / "mh180" / "claim_shares.parquet"
    table = pq.read_table(path)
    place = table.schema.get_field_index("all_share")
    values = table.column(place).to_pylist()
    values[40] = 0.123
    column = pq.read_table(path, columns=["all_share"]).schema.field(0)
    pq.write_table(table.set_column(place, column, [values]), path)
    assert "all_share in row 40" in asked.kinacc("check-results", "results", ok=False)
