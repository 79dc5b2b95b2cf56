"""The tournament's pages and pictures: from its tables, and in step with the assessors."""

from __future__ import annotations

import document_tournament as document
import numpy as np
import paper_settings as paper
import pytest

from kinacc.assess.registry import ADAPTIVE, RECOMMENDED
from kinacc.errors import InputError
from kinacc.figures import save, tournament, tournament_worlds
from kinacc.study.tournament import contest, pages, summary, worlds_page
from kinacc.study.tournament.fields import ErrorField, described

SIZE = contest.Size((0.1, 0.3), {200: (200,)}, 2, 2, (0,))
NAMES = ("model_invalidation", "single_shot", RECOMMENDED, "region_share")


@pytest.fixture(scope="module")
def tables() -> dict:
    """A small tournament over two made-up fields, one of them smaller than asked for."""
    rng = np.random.default_rng(1)
    made = [
        ErrorField(name, 0.4 * rng.normal(size=(n, 3)), kind="synthetic", meaning="chance")
        for name, n in (("first_0", 220), ("small", 60))
    ]
    four = contest.Contest(SIZE, 5, NAMES, paper.study())
    found = contest.summed(contest.jobs(made, SIZE), four)
    cells = summary.in_order(found)
    return {
        "tournament_cells": cells,
        "tournament_verdicts": summary.judged(cells),
        "tournament_fields": described(made),
        "provenance": {"config_hash": "abc", "seed": "5"},
    }


def test_the_page_states_the_ratios_that_the_tables_hold(tables):
    text = pages.tournament({"tiny": tables})
    assert "config_hash `abc`" in text
    cells = tables["tournament_cells"]

    def rmse(name):
        rows = (cells["assessor"] == name) & (cells["target"] == "candidates")
        rows &= (cells["noise_mm"] == 0.3) & (cells["candidates"] == 200)
        return cells["rmse_mm"][rows][0]

    ratio = rmse(RECOMMENDED) / rmse("model_invalidation")
    assert f"| 200 | 200 | 300 um | {ratio:.2f} | {ratio:.2f} (first_0) |" in text
    assert "| small | 100 um |" in text
    assert "](tournament/tiny/coverage.png)" in text


def test_the_pages_tell_the_excess_over_what_is_attained_with_the_errors_known(tables):
    cells = tables["tournament_cells"]
    mine = (cells["assessor"] == RECOMMENDED) & (cells["target"] == "measured")
    mine &= (cells["field"] == "first_0") & (cells["noise_mm"] == 0.3)
    (ratio,) = cells["excess_mm"][mine] / cells["attainable_mm"][mine]
    assert 0.3 < ratio < 4.0
    text = pages.tournament({"tiny": tables})
    (line,) = (each for each in text.splitlines() if each.startswith("| first_0 | 300 um"))
    assert f" | {ratio:.2f} | " in line
    assert f"| {ratio:.2f} ({ratio:.2f}) |" in text
    # Tables of earlier tournaments do not tell.
    old = {name: cells[name] for name in cells if name not in ("attainable_mm", "proven_mm")}
    assert pages.tournament({"tiny": {**tables, "tournament_cells": old}}).count("| - |")


def test_every_assessor_has_a_page_with_its_docstring_and_rows(tables):
    text = pages.assessor("region_share", {"tiny": tables})
    assert text.startswith("# region_share")
    assert "Wilks" in text
    assert "| `share` | `0.9` |" in text
    assert "| region | 100 um |" in text
    assert set(ADAPTIVE) < set(pages.NAMES)
    assert "## In the tournament" not in pages.assessor("two_stage", {"tiny": tables})


@pytest.mark.parametrize("name", ADAPTIVE)
def test_every_docstring_says_source_or_theory_what_is_assumed_and_what_breaks_it(name):
    said = " ".join(ADAPTIVE[name].__doc__.split())
    assert "ssume" in said or "hold whatever" in said
    assert len(said) > 300


@pytest.mark.parametrize("quantity", tournament.QUANTITIES)
def test_every_picture_has_a_panel_for_each_noise_and_all_fields(tables, quantity):
    picture = tournament.draw(tables["tournament_cells"], quantity, 200, 200)
    assert len(picture.axes) == 2
    ticks = [label.get_text() for label in picture.axes[0].get_xticklabels()]
    assert ticks == ["first", "small"]
    assert save.render(picture, ("png",))["png"][:4] == b"\x89PNG"


def test_an_assessor_looks_the_same_whoever_else_takes_part(tables):
    def marks(keep):
        cells = tables["tournament_cells"]
        rows = np.isin(cells["assessor"], keep)
        own = {name: np.asarray(column)[rows] for name, column in cells.items()}
        axes = tournament.draw(own, "rmse", 200, 200, pages.NAMES).axes[0]
        return {each.get_label(): (each.get_marker(), each.get_color()) for each in axes.lines}

    few, all_of = marks(["single_shot", "search_and_confirm"]), marks(list(pages.NAMES))
    for words in ("Single shot", "Search and confirm"):
        assert few[words] == all_of[words]


def test_a_picture_of_nothing_is_refused(tables):
    with pytest.raises(InputError, match="no rmse for 200 candidates and a budget of 7"):
        tournament.draw(tables["tournament_cells"], "rmse", 200, 7)


def test_the_documented_pages_follow_from_the_documented_tables():
    known = document.runs()
    if not known:
        pytest.skip("no tournament is documented")
    for path, text in document.texts(known).items():
        found = (document.DOCS / path).read_text(encoding="utf-8")
        assert found == text, f"{path}: run python tools/document_tournament.py"


@pytest.fixture(scope="module")
def worlds() -> dict:
    """A small tournament in two worlds, with two setups."""
    setups = (
        contest.Setup(worlds=("stated", "drift_3")),
        contest.Setup("references", {"references": 8}, ("drift_3",)),
    )
    size = contest.Size((0.1,), {20: (60,)}, 4, 0, (), ("lone", "flat"), setups)
    given = contest.Contest(size, 5, (RECOMMENDED,), paper.study())
    fields = contest.contested({}, {}, size)
    cells = summary.in_order(contest.summed(contest.jobs(fields, size), given))
    return {
        "tournament_cells": cells,
        "tournament_verdicts": summary.judged(cells),
        "tournament_fields": described(fields),
        "provenance": {"seed": "5"},
    }


def test_the_page_tells_every_setup_in_every_world(worlds):
    text = pages.tournament({"hall": worlds})
    assert (
        "| references | `references: 8` |" not in text
    )  # told as the tournament's own size has it
    assert "| drift_3 | a linear drift of 3 sigma over the campaign |" in text
    lines = [each for each in text.splitlines() if each.startswith(f"| {RECOMMENDED} |")]
    assert [each.split(" | ")[1:6] for each in lines] == [
        ["plain", "stated", "20", "60", "8"],
        ["plain", "drift_3", "20", "60", "8"],
        ["references", "drift_3", "20", "60", "8"],
    ]
    assert "](tournament/hall/worlds.png)" in text


def test_a_campaign_without_a_statement_has_no_false_bound_but_those_stated_count(worlds):
    cells = {name: column.copy() for name, column in worlds["tournament_cells"].items()}
    cells["stated"][:], cells["lower_stated"][:], cells["upper_holds"][:] = 2, 2, 0.5
    for row in worlds_page.of_kinds(cells):
        assert row["upper"] == row["upper_worst"] == pytest.approx(3 / 4)
        assert row["upper_stated"] == pytest.approx(1 / 2)
        assert row["stated"] == pytest.approx(1 / 2)
        assert row["upper_low"] < 3 / 4 < row["upper_high"]


def test_the_picture_of_the_worlds_has_a_row_for_each(worlds):
    picture = tournament_worlds.draw(worlds_page.of_kinds(worlds["tournament_cells"]), 0.95)
    (ax,) = picture.axes
    shown = [label.get_text() for label in ax.get_yticklabels()]
    assert shown == ["references: drift_3", "plain: drift_3", "plain: stated"]
    with pytest.raises(InputError, match="no campaigns"):
        tournament_worlds.draw([], 0.95)
