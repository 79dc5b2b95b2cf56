"""A session that cannot be held back from a fit."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from shared_data import ROOT

from kinacc.config.values import overlay
from kinacc.study.in_memory import run
from kinacc.synthetic import source
from kinacc.workflow.data_sets import read_data_sets

POSES = 150
SETTINGS = overlay(
    read_data_sets([ROOT / "config.yaml"]).settings["mh180"],
    {
        "measurements": {"synthetic": {"poses": POSES}},
        "calibration": {
            "base_and_tool": "estimated",
            "vec": {"order": 1},
            "dh": {"fit_to": "measurements"},
        },
    },
)


def test_a_session_that_one_fold_holds_alone_always_trains_and_is_named():
    measured = source.run({}, SETTINGS)["measurements"]
    alone = (np.arange(POSES) >= 40) & (np.arange(POSES) < 44)
    session = np.where(alone, "noon", None)
    blocks = overlay(SETTINGS, {"measurements": {"fold_by": "time_block"}})
    with pytest.warns(UserWarning, match="session noon has fewer than 3 rows outside"):
        split = source.split({**measured, "session": session}, blocks)
    np.testing.assert_array_equal(np.isnan(split["fold"]), alone)
    assert (split["subset"][alone] == "train").all()
    made = run(("vec", "dh", "residuals"), blocks, {"measurements": split})
    errors = pd.DataFrame(made["pose_errors"])
    held_out = errors[errors.estimate == "cross_validated"]
    assert not held_out["row"].isin(np.flatnonzero(alone)).any()
    assert held_out["ex_mm"].abs().max() < 3.0
