"""What the figures show: the numbers, the words, and that no word hides another."""

from __future__ import annotations

import numpy as np
import pytest
from figure_words import RESULTS, figures, problems, said, words
from scipy.special import gammainc
from stages_by_hand import tables_in

from kinacc.figures import fig1, fig2, fig3, paper, style
from kinacc.figures.calibration import draw_joint_errors
from kinacc.kinematics import robot

LONG_NAME = "laser tracker campaign of the second machining cell, $spring$_{a}, series B " * 3


@pytest.fixture
def tables():
    return tables_in(RESULTS)


def test_no_word_overlaps_another_leaves_the_figure_or_is_too_small():
    for name, figure in figures(LONG_NAME).items():
        assert problems(figure) == [], name
        assert figure.get_figwidth() <= style.DOUBLE_COLUMN_IN + 1e-9
        assert min(text.get_fontsize() for text in words(figure)) >= 7.0, name
        assert ("series B" in said(figure)) == (name != "fig1")


@pytest.mark.parametrize("measured_mm", [1.0, 1.05, 1.3, 2.4, -1.7, 0.4])
def test_fig1_probability_is_the_chi_square_tail_of_the_paper(measured_mm):
    case = fig1.judge(measured_mm, eta_mm=1.0, sigma_mm=0.25)
    assert case.probability == pytest.approx(1 - gammainc(0.5, case.distance**2 / 2), abs=1e-12)
    assert abs(case.candidate_mm) == pytest.approx(min(abs(measured_mm), 1.0))


def test_fig2_shows_all_points():
    q_rad = np.radians(np.random.default_rng(4).uniform(-60, 60, (40, 6)))
    figure = fig2.draw(robot.load("ur10").dh, q_rad, tool_mm=np.array([0.0, 30.0, 120.0]))
    assert problems(figure) == []
    (ax,) = figure.axes
    limits = np.array([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()])
    points = np.transpose(ax.collections[0]._offsets3d)
    assert np.all((points > limits[:, 0]) & (points < limits[:, 1]))


def test_fig3_has_a_scale_a_row_rings_the_largest_and_dots_what_is_partly_reached(tables):
    table = dict(tables["accuracy_map"])
    every_other = np.arange(table["wanted"].size) % 2 > 0
    table["solutions"] = np.where(every_other, table["solutions"], table["wanted"])
    figure = fig3.draw(table)
    panels = [axes for axes in figure.axes if len(axes.lines) == 3]
    assert len(panels) == 10
    for row, column in ((0, "position_max_mm"), (1, "orientation_max_mrad")):
        for axes, angle in zip(panels[5 * row :], (0, 15, 30, 45, 60), strict=False):
            ends = np.nanmin(table[column]), np.nanmax(table[column])
            assert axes.collections[0].get_clim() == ends
            mine = np.flatnonzero(table["slice_deg"] == angle)
            worst = mine[np.nanargmax(table[column][mine])]
            at = axes.lines[1].get_xydata()[0]
            assert at == pytest.approx([table["radius_mm"][worst], table["height_mm"][worst]])
            assert f"max {table[column][worst]:.2f} m" in axes.get_title()
            some = (table["solutions"] > 0) & (table["solutions"] < table["wanted"])
            assert len(axes.lines[0].get_xdata()) == some[mine].sum()


@pytest.mark.parametrize(("rows", "reached"), [(1, 0), (1, 1), (400, 1)])
def test_fig3_draws_unusual_maps(tables, rows, reached):
    table = {name: column[:rows] for name, column in tables["accuracy_map"].items()}
    if not reached:
        nothing = {"position_max_mm": np.nan, "orientation_max_mrad": np.nan, "solutions": 0}
        table |= {name: np.full(rows, value) for name, value in nothing.items()}
    figure = fig3.draw(table, dataset="x")
    assert problems(figure) == []
    assert ("none reached" in said(figure)) != reached


def test_fig3_lists_only_the_marks_that_are_there(tables):
    table = dict(tables["accuracy_map"])
    some = table["solutions"] > 0
    assert some.all()
    number, wanted = np.arange(some.size), table["wanted"]
    legends = []
    for solutions in (wanted, np.where(number % 2, 1, wanted), np.minimum(number, 1), wanted - 1):
        (legend,) = fig3.draw(table | {"solutions": solutions}).legends
        legends.append({text.get_text() for text in legend.texts})
    ring, there = "largest in the slice", "some poses not reachable"
    assert legends == [
        {ring},
        {ring, there},
        {ring, there, "not reachable"},
        {ring, fig3.EVERYWHERE},
    ]


def test_fig4_bars_reach_from_the_smallest_to_the_largest_beside_the_truth(tables):
    table = tables["study_summary"]
    implied = np.median(table["mean_mm"] - table["bias_mm"])
    figure = paper.draw_noise(table, implied)
    mine = table["assessor"] == "maximum"
    ends = np.array([path.vertices[:, 1] for path in figure.axes[0].collections[0].get_paths()])
    assert ends == pytest.approx(np.stack([table["min_mm"], table["max_mm"]], axis=1)[mine])
    assert f"True accuracy {implied:.3f} mm" in said(figure)


@pytest.mark.parametrize(("rows", "met", "probability"), [(1, 1, 0.61), (5, 0, 0.6), (200, 0, 0.7)])
def test_history_states_outcome_largest_error_and_a_rule_that_was_not_met(
    tables, rows, met, probability
):
    rule = "first simulation; none searched rejects at eta"
    table = {name: column[:rows].copy() for name, column in tables["histories"].items()}
    table |= {"rule_met": np.full(rows, met), "rule": np.full(rows, rule)}
    table["rejection_probability"][-1] = probability
    largest = table["true_mm"].max()
    figure = paper.draw_iterations(table, "rejected", largest)
    assert problems(figure) == []
    text = said(figure)
    # alpha itself does not reject (eq. 22)
    assert ("60 %: rejected" in text, ": not rejected" in text) == (met or rows > 5, rows == 5)
    k = table["iteration"][np.argmax(table["true_mm"])]
    assert f"first measured at k = {k} (dotted)" in text
    assert (rule in text) != met
    away = paper.draw_iterations(table, "rejected", largest + 0.01)
    assert "largest true error not measured" in said(away)


def test_joint_errors_have_bands_of_two_standard_deviations():
    ones = np.ones((1, 6, 2))
    _, turn = draw_joint_errors(ones[:, 0], ones, ones.cumsum(1) / 40, ["deg"]).axes
    band = turn.collections[0].get_paths()[0].get_extents()
    assert (band.y0, band.y1) == pytest.approx((0.8, 1.2))
