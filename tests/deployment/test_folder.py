"""Results folders: what is missing, damaged, or of another robot is named."""

from dataclasses import replace

import numpy as np
import pytest
from small_arms import results

from kinacc.deployment.folder import (
    calibration,
    read_tables,
    require_same_robot,
    selected_model,
)
from kinacc.errors import InputError
from kinacc.geometry import Pose, rotation_x
from kinacc.kinematics import robot

ARM = robot.load("mh180")
TABLES = results("mh180", 80, 3, False)


@pytest.mark.parametrize(
    "other",
    [
        replace(ARM, dh=replace(ARM.dh, d_mm=ARM.dh.d_mm + 1e-3)),
        replace(ARM, dh=replace(ARM.dh, prismatic=np.arange(6) == 2)),
        replace(ARM, joint_map=np.diag([1.0, 1, 1, 1, 1, -1])),
        replace(ARM, flange=Pose(rotation_x(0.1), np.zeros(3))),
        robot.load("iiwa14"),
    ],
)
def test_another_robot_than_that_of_the_results_is_refused(other):
    require_same_robot(ARM, replace(ARM, q_max_rad=2.0 * ARM.q_max_rad), "results")
    with pytest.raises(InputError, match=f"another robot than {other.name}"):
        require_same_robot(ARM, other, "results")


def test_a_model_is_asked_for_where_none_was_selected():
    with pytest.raises(InputError, match="give --model"):
        selected_model(TABLES)


@pytest.mark.parametrize(
    ("words", "changed", "message"),
    [
        (("compliance",), {}, "'compliance' is none of these results"),
        (("dh",), {"frames": {"model": np.array(["dh"])}}, "tables cannot be used"),
        (("dh", "", "b"), {"session": np.array(["a"] * 6)}, "'b' is not there; allowed: a"),
    ],
)
def test_tables_that_hold_no_such_calibration_are_refused(words, changed, message):
    frames = changed.get("frames", {**TABLES["frames"], **changed})
    with pytest.raises(InputError, match=message):
        calibration({**TABLES, "frames": frames}, *words)


def test_all_files_that_are_missing_or_damaged_are_named(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        read_tables(tmp_path / "none")
    (tmp_path / "frames.parquet").write_bytes(b"PAR1")
    with pytest.raises(InputError) as refused:
        read_tables(tmp_path)
    missing, damaged = refused.value.problems
    assert missing.where == str(tmp_path)
    assert all(name in missing.what for name in ("vec_model", "dh_model", "robot"))
    assert damaged.where.endswith("frames.parquet")
