"""An artefact is edited, cut, swapped or lost: the command the check prints makes it good again."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from kinacc.artifacts import store

MODEL = "results/mh180/dh_model.parquet"  # nearly all that follows is made from it
TABLE = "results/own/histories.parquet"  # two figures are
CHUNK = "results/mh180/study_chunk/1-of-2.parquet"


def rewrite(project, name, change):
    """Change the columns of a table and keep all else of its file, as an editor would."""
    import pyarrow.parquet as pq

    path = project.folder / name
    table = pq.read_table(path)
    pq.write_table(change(table), path)


def with_first(column, value):
    def change(table):
        import pyarrow as pa

        place = table.schema.get_field_index(column)
        values = [value, *table[column].to_pylist()[1:]]
        field = table.schema.field(column)
        return table.set_column(place, field, pa.array(values, field.type))

    return change


def model_edited(project):
    rewrite(project, MODEL, with_first("d_mm", 3.0))


def edited(project):
    rewrite(project, TABLE, with_first("eta_mm", 3.0))


def cut(project):
    path = project.folder / TABLE
    path.write_bytes(path.read_bytes()[:900])


def lost(project):
    (project.folder / TABLE).unlink()


def swapped(project):
    shutil.copy(project.folder / "results/mh180/histories.parquet", project.folder / TABLE)


def of_an_old_backup(project):
    """The file of an earlier run, with the date it had."""
    edited(project)
    os.utime(project.folder / TABLE, (1e9, 1e9))


def chunk_cut(project):
    (project.folder / CHUNK).write_bytes(b"PAR1")


def chunk_of_another_run(project):
    chunk = project.folder / "results/own/study_chunk/1-of-2.parquet"
    shutil.copy(chunk, project.folder / CHUNK)


def points_edited(project):
    rewrite(project, "results/own/assessment_points.parquet", with_first("q2", 0.123))


def figure_cut(project):
    (project.folder / "results/own/figures/fig4.svg").write_bytes(b"<svg")


def claims_without_units(project):
    path = "results/mh180/claims.parquet"
    rewrite(project, path, lambda table: table.replace_schema_metadata(None))


def study_edited_beside_a_part_of_other_numbers(project):
    """A part is left from a run in one part; the study itself has been edited."""
    (project.folder / "results/own/study_chunk/1-of-1.parquet").write_bytes(b"PAR1")
    rewrite(project, "results/own/study.parquet", with_first("assessed_mm", 0.5))


def many(project):
    for harm in (model_edited, chunk_cut, figure_cut, points_edited, claims_without_units):
        harm(project)
    (project.folder / "results/mh180/figures/fig1.svg").unlink()


def advised(text: str) -> str:
    """The one command a check prints."""
    (command,) = re.findall(r"^  ((?:snakemake|kinacc|rm) .*)$", text, re.M)
    return command


def follow(project, command: str, folder: Path | None = None) -> str:
    """Run a command in a shell as it was printed."""
    tools = Path(sys.executable).parent
    settings = {"PATH": f"{tools}:{os.environ['PATH']}", "PYTHONPATH": str(project.folder / "src")}
    done = subprocess.run(
        command, shell=True, cwd=folder or project.folder, env=os.environ | settings,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout + done.stderr


@pytest.mark.parametrize(
    "harm",
    [
        edited,
        cut,
        lost,
        swapped,
        of_an_old_backup,
        chunk_of_another_run,
        study_edited_beside_a_part_of_other_numbers,
        figure_cut,
        many,
    ],
)
def test_a_changed_artefact_is_remade_by_the_command_that_is_printed(project, harm):
    before = project.digests()
    harm(project)
    text = project.kinacc("check-results", ok=False)
    follow(project, advised(text))
    assert "all is well" in project.kinacc("check-results")
    assert project.digests() == before
    assert project.to_do() == {}


def test_a_run_that_trips_over_a_cut_artefact_prints_the_command_that_makes_it_again(project):
    before = project.digests()
    cut(project)
    text = project.snakemake(ok=False)
    (command,) = set(re.findall(r"make it again: (snakemake .*)$", text, re.M))
    follow(project, command)
    assert project.digests() == before
    assert project.to_do() == {}


def test_several_tables_of_a_stage_are_one_step(project):
    """One of them is of an older run, whole and with its own digest: nothing uses it."""
    before = project.digests()
    rewrite(project, MODEL, lambda table: table)
    text = project.kinacc("run", "summary", "--dataset", "mh180", ok=False)
    assert "dh_model.parquet: is not the file that stage dh wrote" in text
    (command,) = set(re.findall(r"make it again: (kinacc run dh .*)$", text, re.M))
    follow(project, command)
    assert project.digests() == before


def test_the_printed_command_works_from_another_folder_with_spaces(project, tmp_path):
    before = project.digests()
    figure_cut(project)
    other = tmp_path / "some where"
    other.mkdir()
    shutil.copytree(project.folder / "own data", other / "own data")
    words = [sys.executable, "-m", "kinacc.cli", "check-results", str(project.folder / "results")]
    for name in ("config.yaml", "small.yaml"):
        words += ["--config", str(project.folder / name)]
    settings = os.environ | {"PYTHONPATH": str(project.folder / "src")}
    done = subprocess.run(
        words, cwd=other, env=settings, capture_output=True, text=True, check=False
    )
    follow(project, advised(done.stdout), other)
    assert project.digests() == before
    assert not (other / "results").exists()


def test_results_left_by_hand_elsewhere_are_mended_by_hand(project):
    before = project.digests()
    other = project.folder / "by hand"
    (project.folder / "results").rename(other)
    shutil.rmtree(project.folder / "results", ignore_errors=True)
    (other / "own" / "readings.parquet").write_bytes(b"PAR1")
    follow(project, advised(project.kinacc("check-results", "by hand", ok=False)))
    assert "all is well" in project.kinacc("check-results", "by hand")
    other.rename(project.folder / "results")
    assert project.digests() == before


def test_without_the_configuration_a_command_is_printed_only_where_it_is_sure(project):
    check = [sys.executable, "-m", "kinacc.cli", "check-results"]
    edited(project)
    text = project.run(check, ok=False)  # small.yaml made these results, config.yaml is beside them
    assert "snakemake -c2" not in text
    assert "--config" in text
    for path in (project.folder / "results").glob("*/"):
        shutil.rmtree(path)
    project.run([sys.executable, "-m", "snakemake", "-c2", "results/mh180/robot.parquet"])
    before = store.read(project.folder / "results/mh180/measurements.parquet")["x_mm"]
    (project.folder / "results/mh180/measurements.parquet").write_bytes(b"PAR1")
    command = advised(project.run(check, ok=False))
    assert "--configfile" not in command
    follow(project, f"{command} --until measurements")
    after = store.read(project.folder / "results/mh180/measurements.parquet")["x_mm"]
    assert (after == before).all()
