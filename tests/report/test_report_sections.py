"""Sections on a calibration: golden tables of a measured UR10 with planted facts."""

from __future__ import annotations

import json
import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import shared_data
from parsed import as_page, read, table
from stages_by_hand import tables_in

from kinacc.calibration import noise
from kinacc.calibration.identifiability import POORLY_DETERMINED
from kinacc.kinematics import robot as robots
from kinacc.report import fit_sections
from kinacc.report.summarise import joint_ranges, summarise

RESULTS = shared_data.RESULTS / "ur10_d"
FINDING = ("finding", "level", "what", "lines", "fix", "accepted", "rows")
ALWAYS = "theta of joint 1 +1 mrad, base rz -1 mrad: no pose separates these"
ROBOT = robots.load("ur10")


@pytest.fixture
def tables():
    return {name: dict(table) for name, table in tables_in(RESULTS).items()}


def identified(tables, **parameters: tuple) -> dict:
    """``dh_identified`` with status, std and statement of some parameters: j1__d_mm."""
    frame = pd.DataFrame(tables["dh_identified"]).set_index("parameter")
    frame[["status", "statement"]] = "identified", ""
    for name, (status, std, statement) in parameters.items():
        row = {"status": status, "std": std, "statement": statement}
        frame.loc[name.replace("__", "."), [*row]] = [*row.values()]
    return dict(frame.reset_index())


def selection(tables):
    return fit_sections.selection(tables, summarise(RESULTS, tables, campaigns=()))


def section(make, tables):
    return make(tables, ROBOT, summarise(RESULTS, tables, campaigns=()))


def test_findings_stand_the_gravest_first_with_the_reason_they_were_accepted(tables):
    findings = (
        ("thin_coverage", "note", "joint 4 hardly moves", None, "move it", None, 0),
        ("base_jump", "stops", "the base moved", "lines 9-12", "say so", "moved on purpose", 4),
        ("outliers", "warning", "1 row is off", "line 3", None, None, 1),
        ("left_out", "note", "column temp is not read", None, None, None, 0),
    )
    tables["data_check"] = dict(pd.DataFrame(findings, columns=FINDING).astype(object))
    found = section(fit_sections.data, tables)
    rows = table(found, "Findings of the check: 3 findings").rows
    assert [row[0] for row in rows] == ["stops", "warning", "note"]
    assert rows[0][1:] == (
        *("base_jump", "the base moved", "lines 9-12", "say so", "moved on purpose"),
    )
    assert table(found, "Not used of the measured").rows == (("column temp is not read",),)


def test_excluded_rows_have_the_error_of_the_selected_model(tables):
    rows = [
        ("vec_vs_measured", 9, "slip", 3.0, 4.0, 0.0),
        ("dh_vs_measured", 9, "slip", 9.0, 9.0, 9.0),
        ("vec_vs_measured", 4, "no number", *[np.nan] * 3),
    ]
    names = ["comparison", "line", "reason", "ex_mm", "ey_mm", "ez_mm"]
    tables["excluded_rows"] = dict(pd.DataFrame(rows, columns=names))
    is_vec = np.asarray(tables["model_selection"]["model"]) == "vec"
    tables["model_selection"]["selected"] = is_vec.astype(int)
    found = table(section(fit_sections.data, tables), "Rows left out")
    assert found.rows == (("line 4", "could not be read", "no number"), ("line 9", "5.000", "slip"))


def test_repeats_show_the_noise_with_its_degrees_of_freedom(tables):
    rows = dict(table(section(fit_sections.data, tables), "What was measured").rows)
    text = rows["noise of a reading"]
    known = noise.of_measurements(tables["measurements"], ROBOT)
    counts = tuple(map(int, re.findall(r"(\d+) (?:config|read|degree)", text)))
    assert counts == (known.configurations, known.readings, known.freedom)
    assert float(re.search(r"x ([\d.]+)", text)[1]) == pytest.approx(known.std_mm[0], rel=0.05)


def test_ranges_of_joints_stand_beside_their_limits_deg_and_mm():
    arm = SimpleNamespace(dh=SimpleNamespace(prismatic=[False, True]),
                          q_min_rad=np.array([-np.pi / 2, -100.0]),
                          q_max_rad=np.array([np.pi / 2, 100.0]))  # fmt: skip
    found = joint_ranges({"q1": [-np.pi / 4, np.pi / 4], "q2": [-20.0, 30.0]}, arm)
    columns = ["low", "high", "least", "most", "share"]
    assert found[columns].to_numpy() == pytest.approx(
        np.array([[-45, 45, -90, 90, 0.5], [-20, 30, -100, 100, 0.25]])
    )
    assert found["unit"].tolist() == ["deg", "mm"]


def test_what_other_poses_would_show_stands_first(tables):
    tables["dh_identified"] = identified(
        tables,
        j1__theta_offset_rad=("undetermined", np.nan, ALWAYS),
        j2__a_mm=("prior", 0.5, "known beforehand to 0.5 mm"),
        j3__alpha_rad=("identified", 0.0002, None),
        tool__z_mm=("undetermined", np.nan, f"tool z +1 mm{POORLY_DETERMINED}"),
        base__x_mm=("undetermined", np.nan, None),
    )
    found = section(fit_sections.identifiability, tables)
    first, second = table(found, "What cannot be told apart").rows
    assert first[0] == "tool z +1 mm"
    assert second == (ALWAYS, "no pose of such an arm does: no fault")
    assert "3 undetermined" in read(found).text
    rows = {row[0]: row[1:] for row in table(found, "Status of").rows}
    assert rows["a of joint 2"] == ("prior", "0.5 mm", "known beforehand to 0.5 mm")
    assert rows["alpha of joint 3"] == ("identified", "0.2 mrad", "–")
    assert rows["tool z"][:2] == ("undetermined", "–")
    assert rows["base x"][2].endswith("1.2")  # its share of undetermined directions


def test_the_closest_pair_comes_first_and_the_rank_has_its_limit(tables):
    pairs = [("j1.a_mm", "base.x_mm", 0.25), ("j2.a_mm", "j1.a_mm", -0.97),
             ("j2.a_mm", "j2.a_mm", 1.0), ("j1.d_mm", "base.x_mm", np.nan)]  # fmt: skip
    covariance = pd.DataFrame(pairs, columns=["parameter", "other", "correlation"])
    fit = {"quantity": ["rank", "rank_threshold", *["singular_value"] * 3],
           "value": [2.0, 0.01, 40.0, 10.0, 0.02]}  # fmt: skip
    tables |= {"dh_covariance": dict(covariance), "dh_fit": dict(pd.DataFrame(fit))}
    found = section(fit_sections.identifiability, tables)
    rows = table(found, "The 2 pairs of the largest |correlation|; 1 reach 0.95").rows
    assert rows == (
        ("a of joint 2", "a of joint 1", "-0.970"),
        ("a of joint 1", "base x", "+0.250"),
    )
    for text in ("2 of 3 are fitted", "0.25 times", "0.0005 times", "the limit is 0.01"):
        assert text in read(found).text


def test_the_selected_model_has_its_gain_in_standard_errors_and_the_orders_tried(tables):
    choice = {"model": ["dh", "vec"], "selected": [0, 1], "held_out_rms_mm": [0.4, 0.3],
              "mean_of_folds_mm": [0.41, 0.31], "gain_mm2": [0.0, 0.05],
              "gain_std_error_mm2": [0.0, 0.01], "configurations": [40.0, 40.0]}  # fmt: skip
    tables["model_selection"] = dict(pd.DataFrame(choice))
    tables["vec_model"]["order"] = np.minimum(tables["vec_model"]["order"], 2)
    tried = {"fold": [np.nan, np.nan, 0], "order": [4, 2, 4], "log_evidence": [-860.0, -861, -670],
             "log_evidence_less": [0.0, -1, 0], "chosen": [0, 1, 1]}  # fmt: skip
    prior = dict.fromkeys(("prior_std_mm", "prior_std_mrad", "prior_decay"), 0.3)
    tables["vec_orders"] = dict(pd.DataFrame(tried).assign(**prior))
    found = selection(tables)
    models = table(found, "Models at held-out poses")
    assert models.rows == (
        ("DH", "–", "0.400", "0.410", "–", "–", "–"),
        ("VEC", "2", "0.300", "0.310", "+0.0500", "0.0100", "+5.0"),
    )
    assert models.marked == {1: "selected"}
    orders, chosen = table(found, "Orders tried"), table(found, "Orders chosen")
    assert (orders.rows[0], orders.marked) == (("2", "0.3", "0.3", "0.3", "-1.0"), {0: "← chosen"})
    assert [row[:2] for row in chosen.rows] == [("all, delivered", "2"), ("without fold 0", "4")]
    held_out = [*choice][2:]
    tables["model_selection"] |= dict.fromkeys(held_out, np.full(2, np.nan))
    assert table(selection(tables), "Models at held-out poses").rows[1][2:] == ("–",) * 5


def test_a_page_on_thirty_thousand_rows_can_still_be_mailed(tables):
    known = summarise(RESULTS, tables, campaigns=())
    measured, errors = (pd.DataFrame(tables[name]) for name in ("measurements", "pose_errors"))
    times = 30_000 // len(measured) + 1
    many = [errors.assign(row=errors["row"] + i * len(measured)) for i in range(times)]
    tables["measurements"] = dict(pd.concat([measured] * times, ignore_index=True))
    tables["pose_errors"] = dict(pd.concat(many, ignore_index=True))
    assert len(as_page(fit_sections.residuals(tables, known)).encode()) < 4_000_000


def test_parts_of_a_chart_are_defined_before_they_are_referred_to(tables):
    """In the order of the text: a browser draws no chart otherwise."""
    page = as_page(fit_sections.residuals(tables, summarise(RESULTS, tables, campaigns=())))
    charts = json.loads(re.search(r'id="charts">(.*?)</script>', page)[1])
    defined, referred = set(), 0

    def follow(value):
        nonlocal referred
        if isinstance(value, dict) and set(value) == {"id"}:
            assert value["id"] in defined
            referred += 1
        elif isinstance(value, dict) and value.get("type") == "object":
            defined.add(value["id"])
        for part in value.values() if isinstance(value, dict) else value:
            if isinstance(part, (dict, list)):
                follow(part)

    follow(charts)
    assert referred > 10
