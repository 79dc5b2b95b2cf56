"""What one command writes, the commands a person would take it to next can read."""

from __future__ import annotations

import shutil
from itertools import product

import numpy as np
import pandas as pd
import pytest
from command_line import answer, call
from tracked_arm import Q

from kinacc.campaign.campaign import Campaign

STARTED = ("--model", "dh", "--noise-mm", 0.05, "--frame", "base", "--budget", 8, "--sure")
FILES = ("plan-poses.csv", "campaign next.csv", "predict.csv", "compensate.csv",
         "campaign_points.parquet", "measurements.parquet", "plan-poses.json",
         "plan-poses.parquet")  # fmt: skip
OTHERS = ("plan-poses --candidates", "campaign start --candidates", "compare --joints")
# One reader takes every file and form; the others share its reading.
PAIRS = [
    *product(["predict"], FILES),
    *product(OTHERS, ["predict.csv", "campaign_points.parquet"]),
]


@pytest.fixture(scope="module")
def written(study, tmp_path_factory):
    """A folder with a file of every command that writes joints or poses, of one in every form."""
    base = tmp_path_factory.mktemp("written by others")
    campaign = base / "check"
    call("campaign", "start", campaign, "--calibration", study, *STARTED, "--candidates", 8, code=0)
    plan = ("plan-poses", "mh180", "--poses", 8, "--candidates", 60, "--joints-deg",
            "-30:30,-20:20,-20:20,-30:30,40:70,-30:30")  # fmt: skip
    made = {f"plan-poses.{kind}": plan for kind in ("csv", "json", "parquet")}
    made |= {
        "campaign next.csv": ("campaign", "next", campaign, "--all"),
        "predict.csv": ("predict", study, base / "plan-poses.csv", "--model", "dh"),
        "compensate.csv": ("compensate", study, base / "predict.csv", "--model", "dh"),
    }
    for name, words in made.items():
        call(*words, "-o", base / name, code=0)
    opened = Campaign(campaign)
    while (pose := opened.next_pose()) is not None:
        opened.add_reading(pose.expected_mm + 0.1)
    call("campaign", "report", campaign, code=0)
    for table in (campaign / "report" / "campaign_points.parquet", study / "measurements.parquet"):
        shutil.copy(table, base)
    return base


@pytest.mark.parametrize(("reads", "wrote"), PAIRS)
def test_joints_that_a_command_wrote_are_read_by_the_others(study, written, tmp_path, wrote, reads):
    file = written / wrote
    words = {
        "predict": ("predict", study, file, "--model", "dh"),
        "plan-poses --candidates": ("plan-poses", "mh180", "--candidates", file, "--poses", 7),
        "campaign start --candidates": (
            "campaign", "start", tmp_path / "new", "--calibration", study, *STARTED,
            "--budget", 200, "--candidates", file,
        ),
        "compare --joints": ("compare", "mh180", study, "--joints", file),
    }[reads]  # fmt: skip
    answer(*words)


def test_joints_come_back_from_the_poses_that_were_predicted_there(written):
    planned, back = (
        pd.read_csv(written / f"{name}.csv")[Q] for name in ("plan-poses", "compensate")
    )
    np.testing.assert_allclose(back, planned, atol=1e-6)


def test_rows_without_an_answer_are_told_and_left_out(study, tmp_path):
    wanted, joints, back = (tmp_path / name for name in ("wanted.csv", "joints.csv", "back.csv"))
    near = "1500,200,900,0,1,0,0"
    wanted.write_text(f"x_mm,y_mm,z_mm,qw,qx,qy,qz\n{near}\n9000,0,0,1,0,0,0\n{near}\n")
    call("compensate", study, wanted, "--model", "dh", "-o", joints, code=1)
    done = call("predict", study, joints, "--model", "dh", "-o", back, code=0)
    assert "left out, without joints by their status: line 3" in done.stderr
    assert [*pd.read_csv(back)["row"]] == [2, 4]
