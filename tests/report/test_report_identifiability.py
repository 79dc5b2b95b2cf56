"""The section on what poses leave open names it, says what settles it, and shows close pairs."""

import numpy as np
from made_up_results import covariance, everything, identified, robot, table, words
from parsed import read

from kinacc.calibration.identifiability import POORLY_DETERMINED as WEAK
from kinacc.report import fit_sections

ALWAYS = "theta of joint 1 +1 mrad, base rz -1 mrad: no pose separates these"
SOMETIMES = f"tool z +1 mm{WEAK}"
FIT = {
    "quantity": np.array(["rank", "rank_threshold", *["singular_value"] * 3], dtype=object),
    "value": np.array([2.0, 0.01, 40.0, 10.0, 0.02]),
}


def section(**tables):
    return fit_sections.identifiability(everything() | tables, robot())


def test_what_other_poses_would_show_stands_first_with_what_settles_it():
    told = identified(
        j1__theta_offset_rad=("undetermined", np.nan, ALWAYS),
        base__rz_rad=("undetermined", np.nan, ALWAYS),
        tool__z_mm=("undetermined", np.nan, SOMETIMES),
    )
    found = section(dh_identified=told)
    first, second = table(found, "What cannot be told apart").rows
    assert first[0] == "tool z +1 mm"
    assert "kinacc plan-poses" in first[1]
    assert second == (ALWAYS, "no pose of such an arm does: no fault")
    assert "3 undetermined" in read(found).population


def test_every_parameter_has_its_status_and_standard_deviation():
    told = identified(
        j2__a_mm=("prior", 0.5, "known beforehand to 0.5 mm"),
        j3__alpha_rad=("identified", 0.0002, None),
        tool__rx_rad=("undetermined", np.nan, "a sentence"),
    )
    rows = {row[0]: row[1:] for row in table(section(dh_identified=told), "Status of").rows}
    assert rows["a of joint 2"] == ("prior", "0.5 mm", "known beforehand to 0.5 mm")
    assert rows["alpha of joint 3"] == ("identified", "0.2 mrad", "–")
    assert rows["tool rx"] == ("undetermined", "–", "a sentence")
    assert rows["beta of joint 1"] == ("fixed", "–", "not fitted")


def test_how_weakly_a_direction_may_be_seen_is_told_by_the_rank():
    told = words(section(dh_fit=FIT))
    assert "2 of 3 are fitted" in told
    assert "0.25 times" in told
    assert "0.0005 times" in told
    assert "the limit is 0.01" in told


def test_the_closest_pair_comes_first():
    names = ["base.x_mm", "j1.a_mm", "j1.d_mm", "j2.a_mm"]
    matrix = np.diag([1.0, 4.0, 0.0, 9.0])  # j1.d is undetermined: it has no correlation
    matrix[0, 1] = matrix[1, 0] = 0.5
    matrix[1, 3] = matrix[3, 1] = -0.97 * 6
    found = section(dh_covariance=covariance(names, matrix))
    closest = table(found, "The 3 pairs")
    assert closest.rows[0] == ("a of joint 2", "a of joint 1", "-0.970")
    assert closest.rows[1] == ("a of joint 1", "base x", "+0.250")
    assert "0.95" in closest.caption
