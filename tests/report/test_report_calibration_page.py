"""Sections that repeat what a user wrote, escaped."""

import numpy as np
from made_up_results import (
    check,
    covariance,
    everything,
    identified,
    measurements,
    pose_errors,
    robot,
)
from parsed import as_page

from kinacc.report import fit_sections

EVIL = '</script><script>alert("1")</script>'


def page() -> str:
    tables = everything()
    tables["measurements"]["target"][:] = EVIL
    tables["data_check"] = check(
        ("outliers", "warning", EVIL, f"lines of {EVIL}", EVIL, f"{EVIL} it's so", 1),
        ("left_out", "note", EVIL, None, None, None, 0),
    )
    tables["dh_identified"] = identified(**{f"{EVIL}__x_mm": ("undetermined", np.nan, EVIL)})
    names = [f"{EVIL}.x_mm", "j1.a_mm"]
    tables["dh_covariance"] = covariance(names, [[1.0, 0.2], [0.2, 1.0]])
    return as_page(
        fit_sections.data(tables, robot()), fit_sections.identifiability(tables, robot())
    )


def test_names_in_a_users_file_are_text_on_the_page():
    first = page()
    assert "<script>alert" not in first
    assert "&lt;script&gt;alert" in first


def test_a_page_on_thirty_thousand_rows_can_still_be_mailed():
    rows = 30_000
    joints = np.random.default_rng(0).uniform(-1.0, 1.0, (rows, 4))
    tables = everything() | {
        "measurements": measurements(joints),
        "pose_errors": pose_errors(rows=rows),
    }
    assert len(as_page(fit_sections.residuals(tables, robot())).encode()) < 4_000_000
