"""Planting faults: the tool finds places, plants one without touching the source, and tells."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
from mutation import page, places

ROOT = Path(__file__).parents[2]


def test_faults_of_a_small_module_are_noticed_by_its_own_tests():
    module = "kinacc.distributions"
    source = places.path_of(module)
    before = source.read_bytes(), source.stat().st_mtime_ns
    command = [sys.executable, "tools/mutate.py", "try", module, "--count", "5"]
    said = subprocess.run(
        [*command, "--tests", "test_gamma.py"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    verdicts = re.findall(r"^(killed|survived|timeout|crash)", said, re.MULTILINE)
    assert len(verdicts) == 5, said
    assert verdicts.count("killed") >= 3, said
    assert (source.read_bytes(), source.stat().st_mtime_ns) == before


def test_the_same_seed_draws_the_same_faults_and_one_for_each_line():
    within = ("kinacc.assess.limits", "kinacc.kinematics.tables")
    drawn = places.sequence(within=within)
    assert drawn == places.sequence(within=within)
    assert [each.name for each in drawn] != [each.name for each in places.sequence(16, within)]
    assert len({(each.module, each.line) for each in drawn}) == len(drawn) > 10


def test_a_planted_fault_changes_its_own_place_alone():
    for mutant in places.sequence(within=("kinacc.kinematics.tables",))[:10]:
        sound = ast.unparse(ast.parse(places.path_of(mutant.module).read_text())).splitlines()
        faulty = ast.unparse(places.planted(mutant)).splitlines()
        assert len([1 for a, b in zip(sound, faulty, strict=True) if a != b]) == 1, mutant


@pytest.mark.parametrize(
    ("hits", "count", "low", "high"), [(9, 10, 59.6, 98.2), (850, 1000, 82.7, 87.1)]
)
def test_the_interval_of_a_share_is_wilsons(hits, count, low, high):
    assert page.interval(hits, count) == pytest.approx((low, high), abs=0.05)


def test_the_page_is_the_one_that_the_verdicts_make():
    assert page.TARGET.read_text() == page.page(page.read(), page.equivalents())


def test_every_fault_without_effect_has_a_reason_and_was_not_noticed():
    rows = page.read()
    assert {
        name for name in page.equivalents() if name in rows and not page.survived(rows[name])
    } == set()
    assert all(len(reason.split()) > 3 for reason in page.equivalents().values())
