"""Two calibrations on a page: what is called a change, and what is not."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from parsed import read

from kinacc.calibration.uncertainty import Uncertainty, scale_of
from kinacc.config import schema
from kinacc.deployment.compare import compare
from kinacc.deployment.planning import spread
from kinacc.deployment.record import nominal
from kinacc.deployment.shared_readings import NONE_SHARED
from kinacc.kinematics import dh
from kinacc.kinematics import robot as robots
from kinacc.report import page
from kinacc.report.comparison import comparison_page

STD = 0.02  # mm and mrad


def arm(name="March", fitted=True, **changes):
    """A calibration of an arm whose DH parameters are known to ``STD``, with some changed."""
    made = nominal(robots.load("ur10"), name)
    names = made.model.names
    vector = made.model.start.copy()
    for parameter, by in changes.items():
        vector[names.index(parameter.replace("_", ".", 1))] += by
    made = replace(made, model=made.model.with_parameters(vector), choice="dh")
    if not fitted:
        return made
    covariance = np.diag([(STD * scale_of(each)) ** 2 for each in names])
    open_ = np.zeros((1, len(names)))
    open_[0, names.index("j1.d_mm")] = 1.0
    return replace(made, known=Uncertainty(names, covariance, open_))


def compared(first, second):
    weight = schema.key("calibration.rotation_weight_mm_per_rad")["default"]
    return compare(first, second, spread(first.robot, 40), weight, NONE_SHARED)


def paged(first, second):
    return comparison_page(compared(first, second), first, spread(first.robot, 40))


def far(calibration):
    """The calibration, as if it was fitted elsewhere."""
    return replace(calibration, fitted_range_rad=(np.full(6, 3.0), np.full(6, 3.1)))


class Curves(dh.DHModel):
    """A model whose parameters say nothing by themselves, as those of VEC."""

    comparable = None


def curved():
    fields_ = {each.name: getattr(arm().model, each.name) for each in fields(arm().model)}
    return replace(arm(), model=Curves(**fields_), choice="vec")


@pytest.mark.parametrize(
    ("first", "second", "badge"),
    [
        (arm(), arm("B", j3_alpha_rad=1e-3, j2_a_mm=0.1), ("CHANGED", True)),
        (arm(), arm("B", j2_a_mm=0.01), ("NO CHANGE PROVEN", False)),
        (arm(j2_a_mm=0.5), arm("B", fitted=False), ("UNKNOWN", True)),
        (curved(), far(curved()), ("NOT COMPARABLE HERE", True)),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_the_badge_is_the_verdict(first, second, badge):
    built = paged(first, second)
    assert built.first.badge == badge
    assert bool(built.first.tables) == (badge[0] != "NOT COMPARABLE HERE")


@pytest.mark.parametrize(("row", "verdict"), [(0, "changed"), (22, "change in doubt")])
def test_no_arm_is_called_changed_that_was_measured_elsewhere(row, verdict):
    first, near = arm(), arm("November", j3_alpha_rad=5e-4)
    low = np.sort(spread(first.robot, 40)[:, 0])[row]
    ranges = np.array([low, *[-9.0] * 5]), np.full(6, 9.0)
    found = compared(first, replace(near, fitted_range_rad=ranges))
    assert found.verdict == verdict
    assert found.poses["measured_by_both"].sum() == 40 - row


def test_shifts_worst_poses_and_open_parameters_are_listed():
    bent = paged(arm(), arm("<b>two", j3_alpha_rad=1e-3, j2_a_mm=0.1))
    plain, apart = bent.first.tables[0].rows
    assert plain["rms_mm"] > apart["rms_mm"] > 2 * apart["chance_mm"] > 0.0
    where = next(each for each in bent.sections if each.key == "where")
    sizes = [float(row[2]) for row in read(where).tables[0].rows]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] == pytest.approx(apart["largest_mm"], abs=5e-4)
    rows = {row[0]: row for row in read(bent.sections[-1]).tables[0].rows}
    assert rows["j1.d"][6:] == ("–", "both")
    text = page.html(bent)
    assert "&lt;b&gt;two" in text
    assert "<b>two" not in text
