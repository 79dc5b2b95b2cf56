"""A campaign on a measured series of a UR10, in the frame of its calibration."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import shared_data
from campaign_on_disk import standing
from command_line import call

from kinacc.campaign import folder as campaigns
from kinacc.tables import store

RESULTS = shared_data.RESULTS / "ur10_d"
SIGMA_MM = 0.05


def start(folder, *more, candidates=20, code=0):
    return call("campaign", "start", folder, "--calibration", RESULTS, "--model", "dh",
                "--candidates", candidates, "--noise-mm", SIGMA_MM, *more,
                code=code)  # fmt: skip


def test_a_box_of_joints_that_was_hardly_measured_is_asked_about(tmp_path):
    """In all poses of the series the flange points the same way, in hardly any of the box."""
    folder = tmp_path / "campaign"
    box = ("--joints-deg", ",".join(["-360:360"] * 6))
    said = start(folder, *box, code=2).output
    assert "candidates: 20 of 20" in said
    assert "without --joints-deg" in said
    assert not folder.exists()
    start(folder, *box, "--sure")
    (overruled,) = campaigns.open_(folder).plan.overruled
    assert overruled.startswith("candidates: 20 of 20")


def test_candidates_of_a_thin_series_are_drawn_where_it_was_measured(tmp_path):
    plans = []
    for name, more in (("one", ()), ("same", ()), ("other", ("--seed", 1))):
        start(tmp_path / name, *more)
        plans.append(campaigns.open_(tmp_path / name).plan)
    assert plans[0].about["candidates"] == "drawn between neighbouring measured poses"
    one, same, other = (plan.points.joints for plan in plans)
    np.testing.assert_array_equal(one, same)
    assert not np.isin(one, other).any()
    # Forearm and upper arm are parallel to a plane that the flange keeps to: q2 + q3 + q4 is fixed.
    measured = store.read(RESULTS / "measurements.parquet")
    wanted = sum(measured[f"q{joint}"] for joint in (2, 3, 4))
    found = one[:, 1:4].sum(axis=1)
    assert wanted.min() - 0.01 < found.min() <= found.max() < wanted.max() + 0.01


def test_the_series_itself_imported_whole_says_what_it_says_in_memory(tmp_path):
    folder, file = tmp_path / "campaign", tmp_path / "series.csv"
    joints = {f"q{joint}": f"q{joint}_rad" for joint in range(1, 7)}
    columns = ["pose", *joints, "x_mm", "y_mm", "z_mm"]
    series = pd.DataFrame(store.read(RESULTS / "measurements.parquet"))[columns]
    series.rename(columns=joints).to_csv(file, index=False)
    more = ("--assessor", "single_shot", "--budget", len(series))
    start(folder, *more, candidates=file)
    call("campaign", "record", folder, file, code=0)
    state = campaigns.open_(folder).state
    assert len(state.used) == len(series)
    errors = np.array([each.error_mm for each in state.used])
    # These are the residuals of the calibration itself, in another frame.
    residuals = pd.DataFrame(store.read(RESULTS / "residuals.parquet"))
    wanted = "comparison == 'dh_vs_measured' and subset == 'train' and quantity == 'position'"
    (row,) = residuals[residuals["fold"].isna()].query(wanted).to_dict("records")
    sizes = np.linalg.norm(errors, axis=1)
    assert sizes.max() == pytest.approx(row["max"], rel=1e-6)
    assert np.sqrt(np.mean(sizes**2)) == pytest.approx(row["rms"], rel=1e-6)
    # Bounds at equal points stand once.
    (bound,) = standing(folder)["bounds"]
    assert bound["value_mm"] == pytest.approx(sizes.max(), abs=1e-7)
