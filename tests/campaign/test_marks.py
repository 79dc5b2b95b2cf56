"""A campaign begun by an earlier kinacc: other code is told only where answers may differ."""

from __future__ import annotations

from dataclasses import replace

import pytest
from click.testing import CliRunner

from kinacc.artifacts import provenance
from kinacc.assess.registry import ADAPTIVE
from kinacc.campaign import folder, marks
from kinacc.campaign.plan import assessor_of
from kinacc.cli.group import main

OTHER_CODE = "begun with other code of the assessors"
BEFORE_ROOMS = "a16405ddfdb8c763"  # what version 0.1.0 wrote before its modules moved


def said(path) -> str:
    done = CliRunner().invoke(main, ["campaign", "status", str(path)])
    assert done.exit_code == 0, done.output
    return done.stderr


@pytest.fixture
def begun(make_plan, tmp_path):
    """A folder of a campaign whose plan holds a mark."""

    def start(mark: str | None = None, assessor: str = "search_and_confirm"):
        plan = make_plan(assessor)
        own = marks.assessor_code(plan.assessor) if mark is None else mark
        path = tmp_path / f"{assessor} {own}"
        folder.start(path, replace(plan, about={**plan.about, "assessor_code": own}))
        return path

    return start


@pytest.fixture
def change(monkeypatch):
    """Replace a text in a module's source, as an editor would before the next command."""

    def edit(module: str, old: str, new: str) -> None:
        read = provenance.source

        def changed(name: str, *more):
            text = read(name, *more)
            if name != module:
                return text
            assert old in text
            return text.replace(old, new)

        monkeypatch.setattr(provenance, "source", changed)

    return edit


REBUILT = ("search_and_confirm",)  # their answers are not those of version 0.1.0


@pytest.mark.parametrize("assessor", ["invalidation_calibrated", "single_shot"])
def test_a_campaign_begun_before_modules_moved_goes_on_in_silence(begun, assessor):
    assert OTHER_CODE not in said(begun(BEFORE_ROOMS, assessor))


@pytest.mark.parametrize("assessor", REBUILT)
def test_a_campaign_begun_before_its_assessor_was_rebuilt_is_told_of_it(begun, assessor):
    assert OTHER_CODE in said(begun(BEFORE_ROOMS, assessor))


@pytest.mark.parametrize("assessor", sorted({*marks._ALIKE} & {*ADAPTIVE} - {*REBUILT}))
def test_every_assessor_is_known_to_answer_as_before_modules_moved(assessor):
    """Fails where an assessor's code changed: does it answer as before, `_ALIKE` takes its mark."""
    assert marks.answers_alike(BEFORE_ROOMS, assessor_of(assessor, {"measurements": 40}))


def test_a_mark_nobody_knows_is_told(begun):
    assert OTHER_CODE in said(begun("0123456789abcdef"))


def test_imports_comments_and_docstrings_are_no_other_code(begun, change):
    path = begun()
    change("kinacc.assess.search_and_confirm", "import math", "import kinacc.geometry\nimport math")
    change("kinacc.assess.search_and_confirm", "_MISSED = 0.5", "# kept\n_MISSED = 0.5")
    change("kinacc.assess.population", '"""The largest', '"""Text. The largest')
    assert OTHER_CODE not in said(path)


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("kinacc.assess.search_and_confirm", "_MISSED = 0.5", "_MISSED = 0.4"),
        ("kinacc.assess.sequential_limits", "return ", "return 1.0 * "),
    ],
)
def test_other_numbers_in_what_the_assessor_runs_are_told(begun, change, module, old, new):
    path = begun()
    change(module, old, new)
    assert OTHER_CODE in said(path)


def test_another_assessor_may_change(begun, change):
    path = begun(assessor="single_shot")
    change("kinacc.assess.search_and_confirm", "_MISSED = 0.5", "_MISSED = 0.4")
    assert OTHER_CODE not in said(path)
