"""The measured arms of ``benchmarks/reach.yaml``, as a calibration reads them."""

from __future__ import annotations

from contextlib import chdir
from pathlib import Path

import yaml
from shared_data import ROOT

from kinacc.calibration.observations import from_columns
from kinacc.kinematics import robot
from kinacc.synthetic import source
from kinacc.workflow.data_sets import read_data_sets


def measured_arm(name):
    """Arm, calibration settings and observations of a data set."""
    with chdir(ROOT / "benchmarks"):
        config = yaml.safe_load(Path("reach.yaml").read_text("utf-8"))
        config["datasets"] = {name: config["datasets"][name]}  # data of others may be absent
        settings = read_data_sets([], config, absolute=True).settings[name]
        columns = source.run({}, settings)["measurements"]
    arm = robot.load(settings["robot"])
    return arm, settings["calibration"], from_columns(columns, arm)
