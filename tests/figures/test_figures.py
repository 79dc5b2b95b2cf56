"""What the figures show: the numbers, the words, and that no word hides another."""

from __future__ import annotations

import figure_tables as tables
import numpy as np
import pytest
from figure_words import CYLINDER, boxes, figures, problems, said, words
from scipy.special import gammainc

from kinacc.errors import InputError
from kinacc.figures import fig1, fig2, fig3, fig4, iterations, style, truth
from kinacc.kinematics import robot

LONG_NAME = "laser tracker campaign of the second machining cell, spring, warm machine, series B "


@pytest.mark.parametrize("dataset", [None, "mh180", LONG_NAME * 3])
def test_no_word_overlaps_another_or_leaves_the_figure(dataset):
    found = {name: problems(figure) for name, figure in figures(dataset).items()}
    assert found == {name: [] for name in found}


def test_text_is_readable_at_the_printed_size():
    for name, figure in figures(LONG_NAME).items():
        assert figure.get_figwidth() <= style.DOUBLE_COLUMN_IN + 1e-9
        sizes = {text.get_fontsize() for text in words(figure)}
        assert min(sizes) >= 7.0, name


def test_a_long_name_keeps_both_its_ends():
    short = style.shortened("series_A_" + "x" * 90 + "_final", 30)
    assert len(short) == 30
    assert short.startswith("series_A")
    assert short.endswith("_final")


def test_a_name_with_dollar_signs_is_written_as_it_is():
    assert "cell $1$_{a}" in said(fig1.draw(dataset="cell $1$_{a}"))


# Fig. 1


@pytest.mark.parametrize("measured_mm", [1.0, 1.05, 1.3, 2.4, -1.7])
def test_fig1_probability_is_the_chi_square_tail_of_the_paper(measured_mm):
    case = fig1.judge(measured_mm, eta_mm=1.0, sigma_mm=0.25)
    assert case.probability == pytest.approx(1 - gammainc(0.5, case.distance**2 / 2), abs=1e-12)
    assert abs(case.candidate_mm) == pytest.approx(1.0)


def test_fig1_a_measurement_inside_the_bound_is_its_own_candidate():
    case = fig1.judge(0.4, eta_mm=1.0, sigma_mm=0.25)
    assert (case.candidate_mm, case.probability) == (0.4, 1.0)


def test_fig1_states_the_large_probability_above_the_small_one():
    example = fig1.Example()
    assert example.true_mm > example.eta_mm
    figure = fig1.draw(example)
    stated = [
        next(t.get_text() for t in axes.texts if t.get_text().startswith("Pₖ"))
        for axes in figure.axes
    ]
    computed = [
        fig1.judge(measured, example.eta_mm, example.sigma_mm).probability
        for measured in (example.far_mm, example.near_mm)
    ]
    assert stated == [f"Pₖ = {p:.2f}" for p in computed]
    assert computed[0] > 3 * computed[1]


# Fig. 2


def test_fig2_draws_an_arm_without_a_cylinder_and_with_a_tool():
    arm = robot.load("ur10").dh
    q_rad = np.radians(np.random.default_rng(4).uniform(-60, 60, (40, 6)))
    figure = fig2.draw(arm, q_rad, tool_mm=np.array([0.0, 30.0, 120.0]))
    assert problems(figure) == []


def test_fig2_has_equal_scales():
    axes = fig2.draw(robot.load("mh180").dh, tables.joint_angles(), cylinder=CYLINDER).axes[0]
    spans = [np.ptp(limits) for limits in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())]
    assert axes._box_aspect / spans == pytest.approx(np.full(3, axes._box_aspect[0] / spans[0]))


def test_fig2_shows_the_space_and_the_points_whole():
    arm = robot.load("mh180").dh
    axes = fig2.draw(arm, tables.joint_angles(1), cylinder=CYLINDER).axes[0]
    assert axes.get_xlim()[1] > 2100
    assert axes.get_zlim()[0] < 0
    assert axes.get_zlim()[1] > 500


def test_fig2_without_a_point_says_so():
    with pytest.raises(InputError, match="assessment_points"):
        fig2.draw(robot.load("mh180").dh, np.full((3, 6), np.nan))


# Fig. 3


def test_fig3_shares_one_colour_scale_per_row_and_hatches_what_is_not_reached():
    table = tables.accuracy_map()
    figure = fig3.draw(table)
    panels = [axes for axes in figure.axes if len(axes.lines) == 3]
    assert len(panels) == 10
    for row, column in ((0, "position_max_mm"), (1, "orientation_max_mrad")):
        limits = {axes.collections[0].get_clim() for axes in panels[5 * row : 5 * row + 5]}
        assert limits == {(np.nanmin(table[column]), np.nanmax(table[column]))}
    assert all(axes.patch.get_hatch() for axes in panels)
    assert "not reachable" in said(figure)


def test_fig3_rings_the_largest_cell_of_each_slice():
    table = tables.accuracy_map()
    panels = [axes for axes in fig3.draw(table).axes if len(axes.lines) == 3]
    for axes, angle in zip(panels, (0, 15, 30, 45, 60), strict=False):
        mine = np.flatnonzero(table["slice_deg"] == angle)
        worst = mine[np.nanargmax(table["position_max_mm"][mine])]
        at = axes.lines[1].get_xydata()[0]
        assert at == pytest.approx([table["radius_mm"][worst], table["height_mm"][worst]])
        assert f"max {table['position_max_mm'][worst]:.2f} mm" in axes.get_title()


def test_fig3_dots_cells_reached_in_some_poses_only():
    table = tables.accuracy_map()
    assert "some poses" not in said(fig3.draw(table))
    some = (table["radius_mm"] > 1700) & (table["solutions"] > 0)
    table["solutions"] = np.where(some, 11, table["solutions"])
    figure = fig3.draw(table)
    assert "some poses not reachable" in said(figure)
    first = table["slice_deg"] == 0
    assert len(figure.axes[0].lines[0].get_xdata()) == np.count_nonzero(some & first)
    assert problems(figure) == []
    alone = {name: column[first] for name, column in table.items()}
    assert problems(fig3.draw(alone)) == []


def test_fig3_places_each_value_in_its_own_cell_whatever_the_row_order():
    table = tables.accuracy_map(slices=(0,), step_mm=100.0)
    mixed = np.random.default_rng(1).permutation(table["radius_mm"].size)
    panel = fig3.draw({name: column[mixed] for name, column in table.items()}).axes[0]
    grid = panel.collections[0].get_array()
    expected = table["position_max_mm"].reshape(10, 6).T
    assert np.array_equal(grid.filled(np.nan), expected, equal_nan=True)


@pytest.mark.parametrize(
    "table",
    [
        tables.accuracy_map(slices=(0,)),
        tables.accuracy_map(slices=(0, 30), inner_mm=0.0),
        tables.accuracy_map(inner_mm=5000.0),  # nothing reached
        {name: column[:1] for name, column in tables.accuracy_map().items()},
    ],
    ids=["one slice", "two slices", "nothing reached", "one cell"],
)
def test_fig3_draws_unusual_maps(table):
    assert problems(fig3.draw(table, dataset="x")) == []


def test_fig3_names_all_missing_columns():
    table = tables.accuracy_map()
    del table["radius_mm"], table["orientation_max_mrad"]
    with pytest.raises(InputError) as error:
        fig3.draw(table)
    assert len(error.value.problems) == 2


# Fig. 4


def test_fig4_takes_the_truth_from_the_summary_where_it_is_not_given():
    assert "True accuracy\n0.906 mm" in said(fig4.draw(tables.study_summary()))


def test_fig4_says_that_a_measured_truth_contains_noise():
    figure = fig4.draw(tables.study_summary(), true_accuracy_mm=1.2, taken_as_true=truth.FOOTNOTE)
    assert "instrument's noise" in said(figure)
    assert "“True” accuracy*" in said(figure)
    assert problems(figure) == []


def test_fig4_bars_reach_from_the_smallest_to_the_largest():
    table = tables.study_summary()
    axes = fig4.draw(table).axes[0]
    mine = table["assessor"] == "maximum"
    ends = np.array([path.vertices[:, 1] for path in axes.collections[0].get_paths()])
    assert ends[:, 0] == pytest.approx(table["min_mm"][mine])
    assert ends[:, 1] == pytest.approx(table["max_mm"][mine])


def test_fig4_survives_one_noise_level_and_missing_values():
    assert problems(fig4.draw(tables.study_summary(noise_mm=(0.3,)))) == []
    table = tables.study_summary()
    table["mean_mm"][[0, 7]] = np.nan
    table["min_mm"][3] = np.nan
    assert problems(fig4.draw(table)) == []


def test_fig4_keeps_names_apart_where_lines_end_at_the_same_height():
    together = {name: lambda s: (0.91, 0.1, 0.1) for name in ("maximum", "outlier_rejection")}
    more = {f"new_method_{i}": lambda s: (0.9, 0.1, 0.1) for i in range(3)}
    assert problems(fig4.draw(tables.study_summary(assessors=together | more))) == []


def test_names_are_spread_evenly_and_stay_inside():
    placed = style.spread([0.5, 0.5, 0.5, 0.99], 0.1, 0.0, 1.0)
    assert sorted(np.round(placed, 6)) == [0.4, 0.5, 0.6, 0.99]
    crowded = style.spread([0.9] * 5, 0.4, 0.0, 1.0)
    assert sorted(crowded) == pytest.approx([0, 0.25, 0.5, 0.75, 1.0])


# Figs. 5 and 6


def test_history_knows_resampling_by_the_point_and_not_by_the_count():
    point = np.array([4, 2, 2, 4, 7, 2])
    assert list(iterations.resampled(point)) == [False, False, True, True, False, True]


def test_history_says_what_came_of_it():
    table = tables.history(0.834, seed=0)
    table["rejection_probability"][-1] = 0.61
    assert "η = 0.834 mm, noise 300 µm, α = 60 %: rejected" in said(draw(table))
    table["rejection_probability"][-1] = 0.60  # alpha itself does not reject (eq. 22)
    assert ": not rejected" in said(draw(table))


def test_history_draws_each_measurement_once_as_first_or_as_average():
    table = tables.history(0.834, seed=0)
    lines = {line.get_label(): line.get_xydata() for line in draw(table).axes[0].lines}
    again = iterations.resampled(table["point"])
    first, average = lines["first measurement"], lines["after resampling (average)"]
    assert np.array_equal(first[:, 1], table["measured_mm"][~again])
    assert np.array_equal(average[:, 1], table["averaged_mm"][again])
    assert len(first) + len(average) == table["iteration"].size


def test_history_marks_where_the_largest_true_error_is_first_measured():
    table = tables.history(0.834, seed=0)
    first = table["iteration"][np.argmax(table["true_mm"])]
    figure = draw(table, true_accuracy_mm=tables.TRUE_MM)
    assert f"first measured at k = {first} (dotted)" in said(figure)
    figure = draw(table, true_accuracy_mm=tables.TRUE_MM + 0.01)
    assert "largest true error not measured" in said(figure)


@pytest.mark.parametrize("met", [0, 1])
def test_history_says_where_the_rule_of_the_example_was_not_met(met):
    table = tables.history(0.834, seed=0)
    count = table["iteration"].size
    rule = "first simulation; none searched rejects at eta"
    table |= {"rule": np.full(count, rule, dtype=object), "rule_met": np.full(count, met)}
    figure = draw(table, true_accuracy_mm=tables.TRUE_MM)
    assert (rule in said(figure)) == (met == 0)
    assert problems(figure) == []


def test_history_sorts_by_iteration():
    table = tables.history(0.834, seed=0)
    mixed = {name: column[::-1] for name, column in table.items()}
    assert said(draw(mixed)) == said(draw(table))


def test_history_with_a_measured_truth_says_so():
    figure = draw(tables.history(), true_accuracy_mm=0.906, taken_as_true=truth.FOOTNOTE)
    assert "instrument's noise" in said(figure)
    assert "“true” error*" in said(figure)
    assert problems(figure) == []


@pytest.mark.parametrize("count", [1, 2, 5])
def test_history_draws_few_iterations(count):
    assert problems(draw(tables.history(iterations=count))) == []


def test_history_without_the_example_says_which_there_are():
    with pytest.raises(InputError, match="found: rejected"):
        iterations.draw(tables.history(), example="elsewhere")


def draw(table, **settings):
    return iterations.draw(table, example="rejected", **settings)


# The truth


def test_true_accuracy_is_the_largest_true_error():
    def known(**inputs):
        settings = {"evaluation": {"space": "cylinder"}, "measurements": {"source": "synthetic"}}
        return truth.known(inputs, settings)["true_accuracy_mm"]

    assert known(assessment_points={"true_error_mm": np.array([0.2, np.nan, 0.7])}) == 0.7
    assert known() is None
    assert known(assessment_points={"true_error_mm": np.array([])}) is None


def test_only_the_synthetic_arm_has_a_truth_that_is_known():
    def footnote(space, source):
        settings = {"evaluation": {"space": space}, "measurements": {"source": source}}
        return truth.known({}, settings)["taken_as_true"]

    assert footnote("cylinder", "synthetic") is None
    assert "noise" in footnote("measured", "file")
    assert "VEC minus DH" in footnote("cylinder", "file")


def test_every_axis_of_the_arm_has_at_least_three_ticks_and_the_picture_a_legend():
    model = robot.load("mh180").dh
    q_rad = np.random.default_rng(1).uniform(-0.05, 0.05, (30, 6))
    figure = fig2.draw(model, q_rad, measured=True)
    (ax,) = figure.axes
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        low, high = axis.get_view_interval()
        ticks = axis.get_major_locator()()
        assert sum(low <= tick <= high for tick in ticks) >= 3
    words = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert any("30 measured poses" in each for each in words)
    assert any("arm" in each for each in words)


def test_a_slice_of_the_map_says_what_its_angle_is_about():
    figure = fig3.draw(tables.accuracy_map())
    words = " ".join(text.get_text() for text in figure.texts)
    assert "about the robot's first axis" in " ".join(words.split())
    assert "DH to VEC" in words


def test_boxes_see_an_overlap():
    figure = fig1.draw()
    assert len(boxes(figure)) > 10
    figure.axes[0].set_title("a title", loc="left")
    figure.axes[0].set_title("a title that runs across the figure into the other", loc="right")
    assert any("overlaps" in problem for problem in problems(figure))
