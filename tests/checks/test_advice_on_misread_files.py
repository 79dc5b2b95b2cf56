"""What check-data advises on files whose numbers mean something else than they say."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from good_files import File, measured

from kinacc.kinematics import robot as robots
from kinacc.measurements.intake.write import shipped_text

NOISE_MM = 0.2


def tracked(name, target_mm, off_mm=0.0):
    """A file of an arm whose links and offsets are off their description by up to ``off_mm``."""
    arm, rng = robots.load(name), np.random.default_rng(1)
    lengths = {n: getattr(arm.dh, n) for n in ("a_mm", "d_mm")}
    lengths = {n: old + rng.uniform(-off_mm, off_mm, old.shape) for n, old in lengths.items()}
    low, high = np.maximum(arm.q_min_rad, -2.0), np.minimum(arm.q_max_rad, 2.0)
    q = rng.uniform(0.9 * low, 0.9 * high, (60, arm.dh.joints))
    pose = robots.forward(replace(arm, dh=replace(arm.dh, **lengths)), q)
    point = pose.position_mm + pose.rotation @ np.array(target_mm)
    point += rng.normal(0, NOISE_MM, point.shape)
    names = [*(f"q{i + 1}_deg" for i in range(q.shape[1])), "x_mm", "y_mm", "z_mm"]
    return File(pd.DataFrame(np.hstack([np.rad2deg(q), point]), columns=names), name)


def findings(file, tmp_path):
    return {each.kind: each for each in file.check(tmp_path).suspicions}


@pytest.mark.parametrize("target_mm", [[0, 0, 100], [30, -20, 100]])
def test_the_joint_map_that_is_advised_mends_a_coupling(target_mm, tmp_path):
    file = tracked("irb120", target_mm)
    file = file.but(q3_deg=file.columns["q3_deg"] - file.columns["q2_deg"])
    found = findings(file, tmp_path)["joint_coupling"]
    assert (found.values["joint"], found.values["other"]) == (3, 2)
    (tmp_path / "own.yaml").write_text(
        f"{shipped_text('irb120')}\njoint_map: {yaml.safe_load(found.values['map'])}\n"
    )
    found = findings(replace(file, robot=tmp_path / "own.yaml"), tmp_path)
    assert not {"joint_coupling", "does_not_fit"} & set(found)


def test_sound_rows_that_alone_show_a_movement_are_no_slips(tmp_path):
    # Every fifth pose of a measured UR10 whose joint 4 has moved by 1 mrad: no other pose is near
    # the last two, and without them nothing tells where they are to within 0.3 m.
    file = measured("ur10_d").rows(slice(0, 299, 5))
    file = file.but(q4_deg=file.columns["q4_deg"] + np.rad2deg(1e-3))
    assert not findings(file, tmp_path)
