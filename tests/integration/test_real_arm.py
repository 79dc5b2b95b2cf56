"""The measured UR10 of `examples/ur10.yaml`, with its data."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from kinacc.artifacts.store import read

ROOT = Path(__file__).resolve().parents[2]
REACH_RMS_MM = {"ur10_b": 0.475, "ur10_d": 0.43}


@pytest.fixture(scope="module")
def calibrated(finished, tmp_path_factory):
    """A project with the examples and their data, the models of both series fitted."""
    project = finished.copied(tmp_path_factory.mktemp("real") / "a project")
    shutil.copytree(ROOT / "examples", project.folder / "examples")
    targets = [f"results/{name}/residuals.parquet" for name in REACH_RMS_MM]
    project.snakemake(*targets, configs=("config.yaml", "examples/ur10.yaml"))
    return project


def test_held_out_positions_are_met_as_well_as_an_independent_fit_met_them(calibrated):
    for name, reach in REACH_RMS_MM.items():
        table = read(calibrated.folder / "results" / name / "residuals.parquet")
        row = (
            (table["comparison"] == "dh_vs_measured")
            & (table["subset"] == "validation")
            & (table["quantity"] == "position")
            & np.isnan(table["fold"])
        )
        assert table["rms"][row].item() <= reach


def test_a_real_arm_goes_all_the_way_and_says_what_it_leaves_out(calibrated, tmp_path):
    ur10 = calibrated.copied(tmp_path / "a project")
    path = ur10.folder / "examples" / "ur10.yaml"
    settings = yaml.safe_load(path.read_text())
    del settings["datasets"]["ur10_b"]
    path.write_text(yaml.safe_dump(settings))
    configs = ("config.yaml", "small.yaml", "examples/ur10.yaml")
    text = ur10.snakemake(configs=configs)
    assert "ur10_d: accuracy_map is left out" in text
    folder = ur10.folder / "results" / "ur10_d"
    assert (folder / "figures" / "fig4.svg").is_file()
    assert not (folder / "claims.parquet").exists()  # they are about the paper's arm
    assert not (folder / "accuracy_map.parquet").exists()
    assert "all is well" in ur10.kinacc("check-results", "results", configs=configs)
