"""A calibrated arm as robot file, JSON, CSV and tables: complete, exact, all or nothing."""

import json
from dataclasses import replace

import numpy as np
import pytest
from oracles.controllers.arms import frame
from oracles.kinematics import dh_forward
from scipy.spatial.transform import Rotation
from shared_data import RESULTS

from kinacc.deployment.export.files import FORMATS, contents, write
from kinacc.deployment.export.paper_tables import with_deviation
from kinacc.deployment.export.source import Source, notes, read_source
from kinacc.deployment.record import nominal
from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState


def written(form, arm):
    return FORMATS[form].text(Source(arm, {}))


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1150.21234, 0.0353, "1150.212 ± 0.035"),
        (-0.0014806, 0.0000253, "-0.001481 ± 0.000025"),
        (1234.0, 120.0, "1234 ± 120"),
        (-1e-17, np.nan, "0.0000†"),
    ],
)
def test_values_carry_two_digits_of_their_deviation(value, std, text):
    assert with_deviation(value, std) == text


def test_tables_of_a_paper_show_the_selected_model_deviations_and_what_is_left_open():
    """Of a UR10 whose flange pointed one way; the other formats are golden."""
    folder = RESULTS / "ur10_d"
    source = read_source(folder)
    markdown, latex = contents(source, ("markdown", "latex")).values()
    for text, signs in ((markdown, "± †"), (latex, r"$\pm$ $^\dagger$")):
        assert all(part in text for part in ("tool z", *signs.split()))
    for row in ("632 | 0.286 | 0.905 | 0.325 | 0.754", "| 163.536 ± 0.038 | 0.136 ± 0.027 |"):
        assert row in markdown
    weak, selected = notes(source)
    assert "tool z" in weak
    assert "VEC was selected" in selected


def test_nothing_is_written_over_or_in_part(tmp_path):
    write({"a.txt": "first"}, tmp_path)
    with pytest.raises(InputError, match="--force"):
        write({"b.txt": "new", "a.txt": "second"}, tmp_path)
    assert (tmp_path / "a.txt").read_text() == "first"
    assert not (tmp_path / "b.txt").exists()
    assert len(write({"b.txt": "new", "a.txt": "second"}, tmp_path, force=True)) == 2
    assert (tmp_path / "a.txt").read_text() == "second"


def test_json_rebuilds_an_arm_whose_first_axis_points_down():
    """A modified table has frames before its first row and none behind its last."""
    text = """
convention: modified
dh:
  - {theta_offset_deg: 0, d_mm: -400, a_mm: 0, alpha_deg: 180, limits_deg: [-140, 140]}
  - {theta_offset_deg: 0, d_mm: 0, a_mm: 25, alpha_deg: 90, limits_deg: [-145, 145]}
  - {joint: prismatic, theta_offset_deg: 0, d_mm: 5, a_mm: 250, alpha_deg: 0, limits_mm: [0, 200]}
  - {theta_offset_deg: 0, d_mm: 50, a_mm: 0, alpha_deg: 90, limits_deg: [-90, 90]}
"""
    arm = replace(nominal(robot.of_text(text, "down.yaml")), choice="dh")
    content = json.loads(written("json", arm))
    q = np.array([0.3, -0.7, 120.0, 0.2])
    first = content["first_dh_frame_in_base"]
    turned = Rotation.from_quat(first["quaternion_wxyz"], scalar_first=True)
    here = frame(*first["position_mm"], turned)
    for joint, value in zip(content["joints"], q, strict=True):
        row = [joint[name] for name in ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad")]
        row[joint["type"] == "prismatic"] += value
        here = here @ dh_forward([(*row, 0.0)], [0.0])
    wanted = arm.pose(JointState(q), "base", "flange")
    np.testing.assert_allclose(here[:3, 3], wanted.position_mm[0], rtol=0, atol=1e-9)
