"""What the figures show: the numbers, the words, and that no word hides another."""

from __future__ import annotations

import numpy as np
import pytest
from figure_words import figures, golden, problems, said, settings, words
from matplotlib.collections import PolyCollection
from scipy.special import gammainc

from kinacc.errors import InputError
from kinacc.figures import campaign_plan, fig1, fig2, fig3, fig4, iterations, style, truth
from kinacc.kinematics import robot

LONG_NAME = "laser tracker campaign of the second machining cell, $spring$_{a}, series B " * 3
INF = np.inf


@pytest.fixture
def tables():
    return golden()


@pytest.mark.parametrize("dataset", [None, "mh180", LONG_NAME])
def test_no_word_overlaps_another_leaves_the_figure_or_is_too_small(dataset):
    for name, figure in figures(dataset).items():
        assert problems(figure) == [], name
        assert figure.get_figwidth() <= style.DOUBLE_COLUMN_IN + 1e-9
        assert min(text.get_fontsize() for text in words(figure)) >= 7.0, name
        assert ("series B" in said(figure)) == (dataset == LONG_NAME and name != "fig1")


def test_an_overlap_is_seen():
    figure = fig1.draw()
    figure.axes[0].set_title("a title", loc="left")
    figure.axes[0].set_title("a title that runs across the figure into the other", loc="right")
    assert any("overlaps" in problem for problem in problems(figure))


@pytest.mark.parametrize("measured_mm", [1.0, 1.05, 1.3, 2.4, -1.7, 0.4])
def test_fig1_probability_is_the_chi_square_tail_of_the_paper(measured_mm):
    case = fig1.judge(measured_mm, eta_mm=1.0, sigma_mm=0.25)
    assert case.probability == pytest.approx(1 - gammainc(0.5, case.distance**2 / 2), abs=1e-12)
    assert abs(case.candidate_mm) == pytest.approx(min(abs(measured_mm), 1.0))


def test_fig2_draws_to_the_fitted_tool_or_else_to_the_configured_one(tables):
    def drawn(fitted_mm, tool_mm):
        is_tool = (tables["frames"]["model"] == "dh") & (tables["frames"]["frame"] == "tool")
        frames = tables["frames"] | {
            f"{axis}_mm": np.where(is_tool, value, tables["frames"][f"{axis}_mm"])
            for axis, value in zip("xyz", fitted_mm, strict=True)
        }
        figure = fig2.run({**tables, "frames": frames}, settings(tool_mm=tool_mm))
        assert problems(figure) == []
        return figure.axes[0].lines[0].get_data_3d()

    bare, tool = [0.0, 0.0, 0.0], [3.0, 4.0, 250.0]
    assert np.array_equal(drawn(tool, bare), drawn(bare, tool))
    assert np.array_equal(drawn(tool, [9.0, 9.0, 9.0]), drawn(bare, tool))
    assert not np.array_equal(drawn(bare, bare), drawn(bare, tool))


def test_fig2_has_equal_scales_three_ticks_an_axis_and_shows_all_points():
    q_rad = np.radians(np.random.default_rng(4).uniform(-60, 60, (40, 6)))
    figure = fig2.draw(robot.load("ur10").dh, q_rad, tool_mm=np.array([0.0, 30.0, 120.0]))
    assert problems(figure) == []
    assert "40 operating points" in said(figure)
    (ax,) = figure.axes
    limits = np.array([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()])
    spans = np.ptp(limits, axis=1)
    assert ax._box_aspect / spans == pytest.approx(np.full(3, ax._box_aspect[0] / spans[0]))
    points = np.transpose(ax.collections[0]._offsets3d)
    assert np.all((points > limits[:, 0]) & (points < limits[:, 1]))
    for axis, (low, high) in zip((ax.xaxis, ax.yaxis, ax.zaxis), limits, strict=True):
        assert sum(low <= tick <= high for tick in axis.get_major_locator()()) >= 3
    with pytest.raises(InputError, match="assessment_points"):
        fig2.draw(robot.load("mh180").dh, np.full((3, 6), np.nan))


def test_fig3_has_a_scale_a_row_rings_the_largest_and_dots_what_is_partly_reached(tables):
    table = tables["accuracy_map"]
    figure = fig3.draw(table)
    panels = [axes for axes in figure.axes if len(axes.lines) == 3]
    assert len(panels) == 10
    assert "some poses not reachable" in said(figure)
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


def test_fig3_places_each_value_in_its_own_cell_whatever_the_row_order(tables):
    table = tables["accuracy_map"]
    own = np.flatnonzero(table["slice_deg"] == 0)
    mixed = np.random.default_rng(1).permutation(own)
    panel = fig3.draw({name: column[mixed] for name, column in table.items()}).axes[0]
    grid = panel.collections[0].get_array().filled(np.nan)
    expected = table["position_max_mm"][own].reshape(grid.shape[::-1]).T
    assert np.array_equal(grid, expected, equal_nan=True)


@pytest.mark.parametrize("rows", [1, 400, 1200])
@pytest.mark.parametrize("reached", [0, 1])
def test_fig3_draws_unusual_maps(tables, rows, reached):
    table = {name: column[:rows] for name, column in tables["accuracy_map"].items()}
    if not reached:
        nothing = {"position_max_mm": np.nan, "orientation_max_mrad": np.nan, "solutions": 0}
        table |= {name: np.full(rows, value) for name, value in nothing.items()}
    figure = fig3.draw(table, dataset="x")
    assert problems(figure) == []
    assert ("none reached" in said(figure)) != reached


def test_missing_columns_are_all_named():
    with pytest.raises(InputError) as error:
        fig3.draw({"slice_deg": np.zeros(1), "solutions": np.zeros(1), "wanted": np.zeros(1)})
    assert len(error.value.problems) == 4


def test_fig4_bars_reach_from_the_smallest_to_the_largest_beside_the_truth(tables):
    table = tables["study_summary"]
    figure = fig4.draw(table)
    mine = table["assessor"] == "maximum"
    ends = np.array([path.vertices[:, 1] for path in figure.axes[0].collections[0].get_paths()])
    assert ends == pytest.approx(np.stack([table["min_mm"], table["max_mm"]], axis=1)[mine])
    implied = np.median(table["mean_mm"] - table["bias_mm"])
    assert f"True accuracy\n{implied:.3f} mm" in said(figure)


def test_fig4_survives_missing_values_and_lines_that_end_at_the_same_height(tables):
    table = tables["study_summary"]
    table["mean_mm"][[0, 7]], table["min_mm"][3] = np.nan, np.nan
    assert problems(fig4.draw(table)) == []
    alike = {name: column[:6] for name, column in table.items()}
    alike |= {"assessor": np.array([f"new_method_{i}" for i in range(6)]), "noise_mm": np.ones(6)}
    assert problems(fig4.draw(alike | {"mean_mm": np.full(6, 0.9)})) == []


def test_names_are_spread_evenly_and_stay_inside():
    placed = style.spread([0.5, 0.5, 0.5, 0.99], 0.1, 0.0, 1.0)
    assert sorted(np.round(placed, 6)) == [0.4, 0.5, 0.6, 0.99]
    assert sorted(style.spread([0.9] * 5, 0.4, 0.0, 1.0)) == pytest.approx(np.linspace(0, 1, 5))


def example(tables, rows=200, **columns):
    own = {name: column[:rows].copy() for name, column in tables["histories"].items()}
    return own | {name: np.full(rows, value) for name, value in columns.items()}


def test_history_draws_each_measurement_once_as_first_or_as_average(tables):
    table = example(tables)
    mixed = {name: column[::-1] for name, column in table.items()}
    lines = {
        line.get_label(): line.get_xydata()
        for line in iterations.draw(mixed, example="rejected").axes[0].lines
    }
    first = np.isin(np.arange(200), np.unique(table["point"], return_index=True)[1])
    drawn = lines["first measurement"], lines["after resampling (average)"]
    assert np.array_equal(drawn[0][:, 1], table["measured_mm"][first])
    assert np.array_equal(drawn[1][:, 1], table["averaged_mm"][~first])


@pytest.mark.parametrize(("rows", "met", "probability"), [(1, 1, 0.61), (5, 0, 0.6), (200, 0, 0.7)])
def test_history_states_outcome_largest_error_and_a_rule_that_was_not_met(
    tables, rows, met, probability
):
    rule = "first simulation; none searched rejects at eta"
    table = example(tables, rows, rule_met=met, rule=rule)
    table["rejection_probability"][-1] = probability
    largest = table["true_mm"].max()
    figure = iterations.draw(table, example="rejected", true_accuracy_mm=largest)
    assert problems(figure) == []
    text = said(figure)
    # alpha itself does not reject (eq. 22)
    assert ("60 %: rejected" in text, ": not rejected" in text) == (met or rows > 5, rows == 5)
    k = table["iteration"][np.argmax(table["true_mm"])]
    assert f"first measured at k = {k} (dotted)" in text
    assert (rule in text) != met
    away = iterations.draw(table, example="rejected", true_accuracy_mm=largest + 0.01)
    assert "largest true error not measured" in said(away)
    with pytest.raises(InputError, match="found: rejected"):
        iterations.draw(table, example="elsewhere")


@pytest.mark.parametrize(
    ("space", "source", "footnote"),
    [("cylinder", "synthetic", None), ("measured", "file", truth.FOOTNOTE),
     ("cylinder", "file", truth.OF_MODELS)],
)  # fmt: skip
def test_only_the_synthetic_arm_has_a_truth_that_is_known(tables, space, source, footnote):
    known = truth.known(tables, settings(None, source, space=space))
    assert known["true_accuracy_mm"] == tables["assessment_points"]["true_error_mm"].max()
    assert known["taken_as_true"] == footnote
    assert truth.known({}, settings())["true_accuracy_mm"] is None
    for figure in (
        fig4.draw(tables["study_summary"], **known),
        iterations.draw(tables["histories"], example="rejected", **known),
    ):
        assert problems(figure) == []
        assert footnote is None or (footnote in said(figure) and "“true” " in said(figure).lower())


def test_a_plan_reaches_the_top_where_some_campaigns_state_no_bound():
    budget, power = np.array([50.0, 100.0, 200.0]), np.array([0.0, 0.5, 1.0])
    narrow = np.array([[INF, INF, INF], [0.4, 0.5, 0.6], [0.2, 0.2, 0.2]])
    unstated = np.array([[INF, INF, INF], [0.3, 0.4, INF], [0.1, INF, INF]])
    curves = [campaign_plan.Curve("_a", budget, each, power) for each in (narrow, unstated)]
    figure = campaign_plan.draw(curves, 0.3, 0.8, 200)
    left, right = figure.axes
    bands = [each for each in left.collections if isinstance(each, PolyCollection)]
    first, second = (np.vstack([path.vertices for path in each.get_paths()]) for each in bands)
    assert first[:, 1].max() == pytest.approx(0.6)
    assert second[:, 1].max() == pytest.approx(left.get_ylim()[1])
    assert second[:, 0].min() == 100.0  # no bound at all with 50
    assert "80%\nwanted" in [each.get_text() for each in right.texts]
    left, right = campaign_plan.draw(curves, None, None, None).axes
    assert not [*left.texts, *right.texts]
