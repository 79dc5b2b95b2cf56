"""A user changes one thing and runs again: what depends on it is remade, and nothing else."""

import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest

from kinacc.workflow.catalogue import HISTORY, STAGES

FIGURES = {stage.name for stage in STAGES.values() if stage.is_figure and not stage.on_request}
FIGURES -= {*HISTORY}  # of data sets that have a series
AFTER_POINTS = {"study_chunk", "study", "histories", "claims", "report"} | (
    FIGURES - {"fig1", "fig3"}
)
AFTER_DH = {"residuals", "summary", "accuracy_map", "fig3", "assessment_points"} | AFTER_POINTS
ALL = {"measurements", "vec", "dh", "fig1"} | AFTER_DH
NOT_OWN = {"accuracy_map", "fig3", "claims"}  # a measured arm has neither a map here nor claims


def both(stages):
    """Stages of the synthetic arm and, as far as it has them, of the measured one."""
    found = {"mh180": stages, "own": stages - NOT_OWN}
    return {name: each for name, each in found.items() if each}


def test_nothing_changed(project):
    assert project.to_do() == {}


def test_a_comment_in_the_readme(project):
    project.append("README.md", "<!-- a comment -->")
    assert project.to_do() == {}


def test_a_comment_in_the_configuration(project):
    project.append("small.yaml", "# a comment")
    assert project.to_do() == {}


@pytest.mark.parametrize(
    ("change", "reruns"),
    [
        ("map: {grid_mm: 200}", {"mh180": {"accuracy_map", "fig3", "claims", "report"}}),
        (
            "study: {noise_mm: [0.1, 0.2]}",
            both({"study_chunk", "study", "fig4", "claims", "report"}),
        ),
        (
            "histories: {noise_mm: 0.2}",
            both({"histories", "fig5", "fig6", "claims", "report"}),
        ),
        (
            "datasets: {mh180: {calibration: {vec: {order: 3}}}}",
            {"mh180": ALL - {"measurements", "fig1"}},
        ),
        (
            "datasets: {mh180: {calibration: {dh: {truncation: 0.002}}}}",
            {"mh180": {"dh"} | AFTER_DH},
        ),
        (
            "datasets: {mh180: {measurements: {synthetic: {tracker_noise_mm: 0.03}}}}",
            {"mh180": ALL - {"fig1"}},
        ),
        (  # the check of the data depends on it as well
            "datasets: {own: {calibration: {dh: {loss: huber}}}}",
            {"own": ({"data_check", "dh"} | AFTER_DH) - NOT_OWN},
        ),
        (
            "datasets: {own: {evaluation: {points: 11}}}",
            {"own": (AFTER_POINTS | {"assessment_points"}) - NOT_OWN},
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_one_value_of_the_configuration(project, change, reruns):
    project.configure(change)
    assert project.to_do() == reruns


@pytest.mark.parametrize(
    ("module", "reruns"),
    [
        (
            "study/accuracy_map",
            {"mh180": {"accuracy_map", "fig3", "assessment_points"} | AFTER_POINTS},
        ),
        ("figures/fig4", {"mh180": {"fig4"}, "own": {"fig4"}}),
        ("figures/save", both(FIGURES)),
        ("study/claims/numbers", {"mh180": {"claims", "report"}}),
        ("report/residuals", both({"report"})),
        (
            "study/histories",
            both({"histories", "fig5", "fig6", "claims", "report"}),
        ),
        ("kinematics/compliance", {}),  # no data set here asks for that model
        ("calibration/compliance_fit", {}),
        ("calibration/vec_fit", None),
        ("geometry", None),
    ],
)
def test_one_module_of_the_package(project, module, reruns):
    project.append(f"src/kinacc/{module}.py", "# changed")
    found = project.to_do()
    if module == "study/accuracy_map":
        found = {"mh180": found["mh180"]}
    if module == "calibration/vec_fit":
        assert {"vec", "dh", "residuals"} <= found["mh180"]
        assert "measurements" not in found["own"]
        assert "fig1" not in found["mh180"]
        return
    if module == "geometry":
        assert found["mh180"] >= ALL - {"fig1"}
        return
    assert found == reruns


def test_the_cli_and_the_check_are_no_part_of_any_result(project):
    project.append("src/kinacc/cli/group.py", "# changed")
    project.append("src/kinacc/workflow/verification/check.py", "# changed")
    assert project.to_do() == {}


AFTER_ROWS = (ALL | {"data_check"}) - NOT_OWN - {"fig1"}


def change_one_row(project):
    path = project.folder / "own data" / "poses.csv"
    lines = path.read_text().splitlines()
    fields = lines[7].split(",")
    fields[6] = f"{float(fields[6]) + 0.01:.9f}"
    lines[7] = ",".join(fields)
    path.write_text("\n".join(lines) + "\n")


def test_one_row_of_a_file_of_measurements(project):
    change_one_row(project)
    assert project.to_do() == {"own": AFTER_ROWS}


def test_a_run_that_ended_before_the_check_of_changed_rows_leaves_no_old_fit(project):
    change_one_row(project)
    project.snakemake(options=("--until", "measurements"))
    assert project.to_do() == {"own": AFTER_ROWS - {"measurements"}}


def test_a_file_of_measurements_saved_again_unchanged(project):
    path = project.folder / "own data" / "poses.csv"
    path.write_bytes(path.read_bytes())
    assert project.to_do() == {}


def test_a_robot_file(project):
    project.append("src/kinacc/kinematics/robots/mh180.yaml", "# changed")
    reads = {"measurements", "vec", "dh", "residuals", "assessment_points", "fig2"}
    found = project.to_do()
    assert found["mh180"] == reads | {"accuracy_map"} | AFTER_DH
    assert found["own"] == (reads | {"data_check"} | AFTER_DH) - NOT_OWN


def test_the_file_of_another_robot(project):
    project.append("src/kinacc/kinematics/robots/ur10.yaml", "# changed")
    (project.folder / "src/kinacc/kinematics/robots/new.yaml").write_text("name: new\n")
    assert project.to_do() == {}


def test_the_shipped_draws(project):
    project.append("src/kinacc/synthetic/accepted_draws.csv", "# changed")
    assert project.to_do()["mh180"] == ALL - {"fig1"}


def test_the_schema_of_the_configuration_is_read_by_no_stage(project):
    project.append("src/kinacc/config/schema.yaml", "# changed")
    assert project.to_do() == {}


def test_a_deleted_artefact_alone_is_remade(project):
    (project.folder / "results" / "mh180" / "claims.parquet").unlink()
    assert project.to_do() == {"mh180": {"claims", "report"}}


def test_one_artefact_asked_for_by_name(project):
    project.configure("study: {alpha: 0.5}")
    project.configure("map: {grid_mm: 200}")
    before = project.digests()
    project.snakemake("results/mh180/accuracy_map.parquet")
    after = project.digests()
    made = {"mh180/accuracy_map.parquet", "mh180/records/accuracy_map.json"}
    assert {name for name in after if after[name] != before[name]} == made


def test_the_shares_are_in_the_claims_after_one_command(project):
    project.configure("robustness: {draws: 1}")
    claims = project.folder / "results" / "mh180" / "claims.parquet"
    assert np.isnan(pq.read_table(claims)["share"].to_numpy()).all()
    project.snakemake("robustness")
    assert np.isfinite(pq.read_table(claims)["share"].to_numpy()).any()
    assert project.to_do() == {}
    assert "Nothing to be done" in project.snakemake("robustness", options=("--dry-run",))


def test_other_settings_are_noticed_where_snakemake_knows_nothing_of_a_file(project):
    """As where the machine that submitted was lost, and its jobs went on."""
    shutil.rmtree(project.folder / ".snakemake")
    before = project.digests()
    project.snakemake("results/own/histories.parquet")
    assert project.digests() == before
    shutil.rmtree(project.folder / ".snakemake")
    project.configure("histories: {noise_mm: 0.2}")
    project.snakemake("results/own/histories.parquet")
    differ = {name for name, digest in project.digests().items() if digest != before.get(name)}
    assert differ == {"own/histories.parquet", "own/records/histories.json"}
