"""The rules of the workflow as somebody meets them who changes one thing and runs again."""

from __future__ import annotations

import os

import pytest
from whole_project import finished, project

__all__ = ["finished", "project"]

TABLES = {
    *("measurements", "data_check", "fit_vec", "fit_dh", "residuals", "summary", "accuracy_map"),
    *("operating_points", "study_part", "study", "histories", "claims"),
}
SHOWN = {"figures", "map_figure", "report", "digests"}
EVERY = TABLES | SHOWN
ARM, CSV = "results/own", "own data/poses.csv"


def test_after_a_run_there_is_nothing_to_do_and_touching_files_changes_nothing(project):
    for path in (
        *(project.folder / "src").rglob("*.py"),
        *(project.folder / "workflow").rglob("*.*"),
        *(project.folder / name for name in ("Snakefile", "config.yaml", "small.yaml", CSV)),
    ):
        os.utime(path)
    assert project.to_do() == set()


@pytest.mark.parametrize(
    ("files", "made"),
    [
        (["src/kinacc/figures/paper.py"], SHOWN),
        (["src/kinacc/kinematics/dh.py"], TABLES | SHOWN),
        # Commands are no part of any table or picture.
        (
            ["src/kinacc/cli/group.py", "workflow/scripts/claims.py"],
            {"claims", "report", "digests"},
        ),
        (["workflow/scripts/figures.py"], {"figures", "map_figure", "digests"}),
    ],
)
def test_an_edited_line_makes_anew_what_depends_on_it(project, files, made):
    for file in files:
        project.append(file, "# changed")
    assert project.to_do() == made


AFTER_POINTS = {"study_part", "study", "histories", "claims", "figures", "report", "digests"}


@pytest.mark.parametrize(
    ("change", "made"),
    [
        # Gates are no part of any table.
        (
            "{gates: [{name: a, suspicions: none}], map: {grid_mm: 200}}",
            {"accuracy_map", "map_figure", "claims", "report", "digests"},
        ),
        ("histories: {noise_mm: 0.2}", {"histories", "claims", "figures", "report", "digests"}),
        (
            "datasets: {own: {evaluation: {points: 11}}}",
            (AFTER_POINTS - {"claims"}) | {"operating_points"},
        ),
        (
            "datasets: {mh180: {calibration: {vec: {order: 3}}}}",
            EVERY - {"measurements", "data_check"},
        ),
    ],
)
def test_one_value_of_the_configuration_makes_anew_what_reads_it(project, change, made):
    project.configure(change)
    assert project.to_do() == made


def test_a_changed_row_of_a_measured_file_makes_its_data_set_anew(project):
    path = project.folder / CSV
    lines = path.read_text().splitlines()
    cells = lines[7].split(",")
    cells[6] = f"{float(cells[6]) + 0.01:.9f}"
    path.write_text("\n".join([*lines[:7], ",".join(cells), *lines[8:]]) + "\n")
    assert project.to_do() == EVERY - {"accuracy_map", "map_figure", "claims"}
