"""A robot's history as a picture, from a single line to five years of months."""

from __future__ import annotations

import pytest
from figure_words import problems, said
from made_up_history import history

from kinacc.figures import history_over_time


@pytest.mark.parametrize(("lines", "changed"), [(1, None), (3, 2), (60, 23)])
def test_a_history_can_be_read_however_long_it_is(lines, changed):
    table = history(lines, changed, open_=5, tolerance_mm=0.8)
    figure = history_over_time.draw(table, dataset="tracker")
    assert not problems(figure)
    assert ("joint 4" in said(figure)) == (changed is not None)


def test_a_change_stands_above_what_chance_shows():
    figure = history_over_time.draw(history(8, changed=5))
    moved = figure.axes[1]
    marks = {line.get_label(): line.get_ydata() for line in moved.lines}
    assert marks["recalibrate"] == pytest.approx([0.45])
    assert marks["what chance shows at most"] == pytest.approx([0.15] * 7)
    assert moved.get_ylim()[1] > 0.45
