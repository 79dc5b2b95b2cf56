"""The contract is whole, and agrees with the stages."""

from __future__ import annotations

from pathlib import Path

import pytest

from kinacc.tables import store
from kinacc.tables.columns import Column, joint_count
from kinacc.tables.contract import ARTEFACTS

ROOT = Path(__file__).parents[2]

# The columns every reader of the results may rely on, by table.
PROMISED = {
    "measurements": "pose q1 q6 s1 s6 target x_mm y_mm z_mm qw qx qy qz repeat subset",
    "vec_model": "joint error direction order coefficient std q_min_rad q_max_rad "
    "theta_offset_rad d_mm a_mm alpha_rad beta_rad",
    "dh_model": "joint theta_offset_rad d_mm a_mm alpha_rad beta_rad std_theta_offset_rad "
    "std_d_mm std_a_mm std_alpha_rad std_beta_rad",
    "frames": "model frame x_mm y_mm z_mm qw qx qy qz",
    "residuals": "comparison subset fold quantity unit n mean max rms gamma99",
    "accuracy_map": "slice_deg radius_mm height_mm position_max_mm orientation_max_mrad "
    "worst_branch solutions wanted q1 q6",
    "assessment_points": "point q1 q6 s1 s6 ex_mm ey_mm ez_mm true_error_mm",
    "study": "noise_mm repetition assessor assessed_mm measurements points_visited "
    "lower_mm upper_mm",
    "study_summary": "assessor noise_mm mean_mm min_mm max_mm bias_mm rmse_mm repetitions",
    "readings": "assessor outlier_rule distance covariance search noise_mm mean_mm min_mm max_mm "
    "bias_mm",
    "histories": "example noise_mm alpha distance covariance iteration point repeat eta_mm "
    "measured_mm averaged_mm true_mm rejection_probability",
    "claims": "claim statement statistic evidence paper reproduced tolerance verdict share",
    "robustness": "draw claim reproduced verdict",
}


@pytest.mark.parametrize("name", PROMISED)
def test_promised_columns_are_there(name):
    columns = [column.name for column in ARTEFACTS[name].for_joints(6)]
    assert set(PROMISED[name].split()) <= set(columns)


@pytest.mark.parametrize("name", ARTEFACTS)
@pytest.mark.parametrize("joints", [4, 6, 7])
def test_tables_are_well_formed(name, joints):
    artefact = ARTEFACTS[name]
    names = [column.name for column in artefact.for_joints(joints)]
    assert len(names) == len(set(names))
    assert set(artefact.key) <= set(names)
    assert joint_count(artefact, names) == (joints if artefact.has_joints else 0)
    assert store.arrow_schema(name, joints).names == names


@pytest.mark.parametrize("name", ARTEFACTS)
def test_units_are_those_the_names_carry(name):
    endings = ("mm", "mrad", "rad", "deg")
    for column in ARTEFACTS[name].columns:
        assert column.meaning
        assert (column.unit == "") == (column.kind == "text")
        ending = column.name.rpartition("_")[2]
        if ending in endings and "_per_" not in column.name:
            assert column.unit == ending


def test_joint_columns_name_their_joint():
    column = Column("q*", "float", "rad", "position of each joint").numbered(3)
    assert (column.name, column.meaning) == ("q3", "position of joint 3")
