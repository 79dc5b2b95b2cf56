"""What one command writes, the commands a person would take it to next can read."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pandas as pd
import pytest
from command_line import answer, call
from tracked_arm import Q

from kinacc.campaign.campaign import Campaign

KINDS = ("csv", "json", "parquet")
STARTED = ("--model", "dh", "--noise-mm", 0.05, "--frame", "base", "--budget", 8, "--sure")


@pytest.fixture(scope="module")
def written(study, tmp_path_factory):
    """A file of every command that writes joints or poses, in every form, by command and kind."""
    base = tmp_path_factory.mktemp("written by others")
    campaign, made = base / "check", {}
    call("campaign", "start", campaign, "--calibration", study, *STARTED, "--candidates", 8, code=0)
    for kind in KINDS:
        commands = {
            "plan-poses": ("plan-poses", "mh180", "--poses", 8, "--candidates", 60, "--joints-deg",
                           "-30:30,-20:20,-20:20,-30:30,40:70,-30:30", "--hayati", "2"),
            "campaign next": ("campaign", "next", campaign, "--all"),
            "predict": ("predict", study, base / f"plan-poses.{kind}", "--model", "dh"),
            "compensate": ("compensate", study, base / f"predict.{kind}", "--model", "dh"),
        }  # fmt: skip
        for name, words in commands.items():
            made[name, kind] = base / f"{name}.{kind}"
            call(*words, "-o", made[name, kind], code=0)
    opened = Campaign(campaign)
    while (pose := opened.next_pose()) is not None:
        opened.add_reading(pose.expected_mm + 0.1)
    call("campaign", "report", campaign, code=0)
    made["campaign report", "parquet"] = campaign / "report" / "campaign_points.parquet"
    made["measurements", "parquet"] = study / "measurements.parquet"
    return made


TABLES = (("campaign report", "parquet"), ("measurements", "parquet"))
WRITERS = ("plan-poses", "campaign next", "predict", "compensate")
READERS = ("plan-poses --candidates", "campaign start --candidates", "compare --joints")
# One reader takes every form of every command; the others share its reading, and take one form.
PAIRS = [
    *(("predict", wrote) for wrote in (*product(WRITERS, KINDS), *TABLES)),
    *product(READERS, (*((name, "csv") for name in WRITERS), *TABLES)),
]


@pytest.mark.parametrize(("reads", "wrote"), PAIRS, ids=str)
def test_joints_that_a_command_wrote_are_read_by_the_others(study, written, tmp_path, wrote, reads):
    file = written[wrote]
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
        pd.DataFrame(json.loads(written[name, "json"].read_text())["rows"])[Q]
        for name in ("plan-poses", "compensate")
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
