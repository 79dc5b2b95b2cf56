"""Names that people give: they lead nowhere, and are text in Markdown, CSV and LaTeX."""

from __future__ import annotations

import json
import re

import numpy as np
import pandas as pd
import pytest
from command_line import call
from tracked_arm import Q, table

from kinacc.config.names import in_csv, of_csv
from kinacc.kinematics import robot


def test_text_that_would_be_a_formula_is_read_back_as_it_was(study, tmp_path):
    names = ["=cmd|x", "+a", "-5", "-a", "@b", "'plain"]
    joints, found, again = (tmp_path / name for name in ("q.csv", "found.csv", "again.parquet"))
    q_deg = np.eye(6)[4] * np.arange(60.0, 66.0)[:, None]
    joints.write_text(table(["pose", *Q], names, q_deg))
    call("predict", study, joints, "-o", found, code=0)
    cells = pd.read_csv(found, dtype=str)["row"]
    assert [*cells] == ["'=cmd|x", "'+a", "-5", "'-a", "'@b", "'plain"]
    found.write_text(found.read_text().replace("row,", "pose,", 1))
    call("predict", study, found, "-o", again, code=0)
    assert [*pd.read_parquet(again)["row"]] == names


@pytest.mark.parametrize("text", ["=1", "'=1", "''=1", "'", "-1", "-1e-3", "-", "+a", "@", "\t",
                                  "\r", "'-5", "plain", "-5,2"])  # fmt: skip
def test_every_text_comes_back_from_a_cell(text):
    cell = in_csv(text)
    assert of_csv(cell) == text
    assert cell[:1] not in tuple("=@\t\r")
    assert (cell == text) == (text in ("'", "-1", "-1e-3", "plain"))


@pytest.mark.parametrize("name", ["two\nlines", "\x1b[31mred", "\u202eleft"])
def test_a_name_that_does_not_stand_in_a_line_is_refused_where_it_is_given(study, tmp_path, name):
    own = tmp_path / "arm.yaml"
    text = robot.as_yaml(robot.load("mh180"))
    text = re.sub(r"name: .*", lambda _: f"name: {json.dumps(name)}", text, count=1)
    own.write_text(text)
    call("plan-poses", own, code=2)
    call("campaign", "start", tmp_path / "c", "--calibration", study,
         "--instrument", f"{name}=0.1", code=2)  # fmt: skip
    assert not (tmp_path / "c").exists()
