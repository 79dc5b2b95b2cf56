"""The workflow is started from a folder of one's own, which holds no copy of the project."""

from __future__ import annotations

import shutil
import sysconfig
import venv
from pathlib import Path

import pytest

from kinacc.tables.store import digest_of, read


@pytest.fixture
def cell(project, tmp_path) -> Path:
    """A folder with a configuration and measurements alone; its name has a space in it."""
    folder = tmp_path / "robot cell"
    shutil.copytree(project.folder / "own data", folder / "own data")
    shutil.copy(project.folder / "small.yaml", folder / "own.yaml")
    return folder


def started(project, folder: Path, command: list[str], code: int = 0) -> str:
    """Output of a command started in a folder, with the project's code."""
    text = project.run(command, code, cwd=folder)
    assert "Traceback" not in text
    return text


def snakemake(project, *options: str) -> list[str]:
    return ["snakemake", "-c2", "-s", str(project.folder / "Snakefile"), *options]


def test_a_configuration_of_ones_own_folder_goes_before_the_projects(project, cell):
    robot = "results/mh180/robot.parquet"
    (cell / "config.yaml").write_text("datasets: {here: {robot: mh180}}\n")
    text = started(project, cell, snakemake(project, "-n", robot), 1)
    assert "results/mh180/robot.parquet" in text
    started(project, cell, snakemake(project, "-n", "results/here/robot.parquet"))


def test_an_environment_in_a_folder_with_a_space_runs_the_rules(project, cell):
    # As `make reproduce` does in a clone whose path has one.
    venv.create(cell / "own env", symlinks=True)
    packages = next((cell / "own env/lib").glob("python*/site-packages"))
    (packages / "others.pth").write_text(sysconfig.get_path("purelib") + "\n")
    robot = "results/mh180/robot.parquet"
    command = [str(cell / "own env/bin/python"), "-m", *snakemake(project, robot)]
    started(project, cell, command)
    assert (cell / robot).is_file()


MODULE = """\
configfile: "cell.yaml"

module kinacc:
    snakefile: {snakefile!r}
    {prefix}config: config["kinacc"]

use rule * from kinacc as kinacc_*

rule ours:
    default_target: True
    input: "{folder}results/own/measurements.parquet"
    output: "ours.txt"
    shell: "ls {{input:q}} > {{output}}"
"""


@pytest.mark.parametrize("prefix", ["", "arm"])
def test_a_workflow_of_somebody_else_has_kinacc_as_a_module(project, cell, prefix):
    text = MODULE.format(
        snakefile=str(project.folder / "Snakefile"),
        prefix=f"prefix: {prefix!r}\n    " if prefix else "",
        folder=f"{prefix}/" if prefix else "",
    )
    (cell / "Snakefile").write_text(text)
    own = "".join(f"  {line}\n" for line in (cell / "own.yaml").read_text().splitlines())
    (cell / "cell.yaml").write_text(f"theirs: 1\nkinacc:\n{own}")
    started(project, cell, ["snakemake", "-c2"])
    assert (
        cell / "ours.txt"
    ).read_text().strip() == f"{prefix}/results/own/measurements.parquet".strip("/")
    again = started(project, cell, ["snakemake", "-c2"])
    assert "Nothing to be done" in again
    table = "results/own/measurements.parquet"
    assert digest_of("measurements", read(cell / prefix / table)) == digest_of(
        "measurements", read(project.folder / table)
    )


def test_the_report_of_a_run_has_the_page(project):
    project.snakemake(options=("--report", "report.html"))
    page = (project.folder / "report.html").read_text(encoding="utf-8")
    assert "report.html" in page
