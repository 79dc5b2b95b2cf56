"""A measured UR10 of `examples/ur10.yaml`, with its data, all the way through the workflow."""

import shutil
from pathlib import Path

import numpy as np
import yaml

from kinacc.tables.store import read

ROOT = Path(__file__).resolve().parents[2]
REACH_RMS_MM = 0.43  # of an independent fit, at held-out poses


def test_a_real_arm_goes_all_the_way_and_says_what_it_leaves_out(project):
    shutil.copytree(ROOT / "examples", project.folder / "examples")
    path = project.folder / "examples" / "ur10.yaml"
    settings = yaml.safe_load(path.read_text())
    del settings["datasets"]["ur10_b"]  # its reach is held in test_calibration_stages.py
    path.write_text(yaml.safe_dump(settings))
    configs = ("config.yaml", "small.yaml", "examples/ur10.yaml")
    project.snakemake(configs=configs)
    folder = project.folder / "results" / "ur10_d"
    assert (folder / "figures" / "fig4.svg").is_file()
    assert not (folder / "claims.parquet").exists()  # they are about the paper's arm
    assert not (folder / "accuracy_map.parquet").exists()
    table = read(folder / "residuals.parquet")
    row = (table["comparison"] == "dh_vs_measured") & (table["subset"] == "validation")
    row &= (table["quantity"] == "position") & np.isnan(table["fold"])
    assert table["rms"][row].item() <= REACH_RMS_MM
    project.kinacc("check-results", "results", configs=())
