"""Candidates in the form in which people have them: an export, a sheet, a robot's program."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import call

from kinacc.campaign import folder as campaigns
from kinacc.tables import store

COUNT = 12


@pytest.fixture(scope="module")
def joints(calibration):
    """Some of the joints that were measured (12, 6), rad."""
    measured = store.read(calibration / "measurements.parquet")
    every = np.stack([measured[f"q{joint}"] for joint in range(1, 7)], axis=1)
    return every[np.asarray(measured["subset"]) == "train"][:COUNT]


@pytest.fixture
def start(calibration, tmp_path):
    """Begin a campaign with a file of candidates: its answer, and its plan if there is one."""

    def begin(file, *more):
        folder = tmp_path / "campaign"
        done = call("campaign", "start", folder, "--calibration", calibration, "--model", "dh",
                    "--candidates", file, "--noise-mm", 0.05, "--budget", 20, *more)  # fmt: skip
        return done, campaigns.open_(folder).plan if folder.exists() else None

    return begin


def same(plan, joints, digits=9):
    np.testing.assert_allclose(plan.points.joints, joints, atol=10.0**-digits)


def test_a_german_export_in_degrees_with_decimal_commas(start, joints, tmp_path):
    file = tmp_path / "posen.csv"
    lines = ["Messpunkt;Achse 1 [°];Achse 2 [°];Achse 3 [°];Achse 4 [°];Achse 5 [°];Achse 6 [°]"]
    for number, row in enumerate(np.rad2deg(joints), 1):
        lines.append(";".join([f"P{number}", *(f"{each:.10f}".replace(".", ",") for each in row)]))
    file.write_bytes("\n".join(lines).encode("latin-1"))
    done, plan = start(file)
    assert done.exit_code == 0, done.output
    same(plan, joints)
    assert plan.points.label[:2] == ("P1", "P2")
    assert "decimal commas" in done.stderr
