"""What the gate writes for build servers, read by parsers of other makers, under hostile names."""

from __future__ import annotations

import json
import re
from xml.dom import minidom

import judged
import pytest
import yaml
from lxml import etree
from worlds import asked

HOSTILE = 'a|b <c> & ]]> "d" ::error::e %0A `f` [g](h)'
GATES = [
    {"name": HOSTILE, "value": "residuals.position.mean", "model": "dh", "at_most_mm": 1e-6},
    {"name": "held", "value": "residuals.position.mean", "model": "dh", "at_most_mm": 100.0},
    {
        "name": "warned",
        "value": "residuals.position.rms",
        "model": "dh",
        "at_most_mm": 1e-6,
        "on_fail": "warn",
    },
]


def refused(word: str) -> float:
    raise ValueError(f"{word} is no JSON")


@pytest.fixture
def written(world):
    """By ending what is written of results of which one gate fails, one warns and others hold."""
    settings = yaml.safe_load(world.configs[1].read_text()) | {"gates": GATES}
    world.configs[1].write_text(yaml.safe_dump(settings))
    paths = {ending: world.folder / f"gate.{ending}" for ending in ("json", "xml", "md")}
    out = [word for path in paths.values() for word in ("--out", path)]
    configs = [word for path in world.configs for word in ("--config", path)]
    done = asked("gate", world.results, *configs, "--against", world.accepted, *out, json=False)
    assert done.code == 1, done.text
    yield {ending: path.read_text("utf-8") for ending, path in paths.items()} | {"txt": done.text}
    for path in paths.values():
        path.unlink()


def test_every_form_tells_of_the_same_gates(written):
    told = json.loads(written["json"], parse_constant=refused)
    outcomes = [each for each in judged.mappings(told) if {"verdict", "says"} <= each.keys()]
    by_verdict = {
        word: [each for each in outcomes if each["verdict"] == word]
        for word in ("passed", "warned", "failed")
    }
    assert {each["name"] for each in by_verdict["failed"]} == {HOSTILE}
    assert {each["name"] for each in by_verdict["warned"]} == {"warned"}
    assert len(by_verdict["failed"]) == len(by_verdict["warned"]) == 2  # one of each data set

    page = minidom.parseString(written["xml"])
    cases = page.getElementsByTagName("testcase")
    failed = [case for case in cases if case.getElementsByTagName("failure")]
    assert len(cases) == len(outcomes)
    assert len(failed) == 2
    defused = HOSTILE.replace("::", ": :")  # nothing that a server would take for a command
    assert all(case.getAttribute("name") == defused for case in failed)
    suites = page.getElementsByTagName("testsuite")
    assert sum(int(suite.getAttribute("tests")) for suite in suites) == len(cases)
    assert sum(int(suite.getAttribute("failures")) for suite in suites) == 2
    for suite in suites:
        own = suite.getElementsByTagName("testcase")
        assert int(suite.getAttribute("tests")) == len(own)
    strict = etree.fromstring(written["xml"].encode(), etree.XMLParser(recover=False))
    assert len(strict.findall(".//testcase")) == len(cases)

    for name in ("held", "warned"):
        assert name in written["md"]
        assert name in written["txt"]


def test_hostile_names_make_no_cells_links_or_commands_of_their_own(written):
    rows = [line for line in written["md"].splitlines() if line.startswith("|")]
    assert len({len(re.findall(r"(?<!\\)\|", row)) for row in rows[:3]}) == 1
    for row in rows:
        assert "<c>" not in row
        assert "](h)" not in row or "\\](h)" in row or "`" in row
    assert not re.search(r"^::", written["txt"], re.M)


def test_annotations_are_one_command_a_line(world):
    settings = yaml.safe_load(world.configs[1].read_text()) | {"gates": GATES}
    world.configs[1].write_text(yaml.safe_dump(settings))
    configs = [word for path in world.configs for word in ("--config", path)]
    done = asked("gate", world.results, *configs, "--annotations", "github", json=False)
    lines = done.text.splitlines()
    found = [re.fullmatch(r"::(error|warning|notice) ?([^:]*)::(.*)", line) for line in lines]
    commands = [each.group(1) for each in found if each]
    assert commands.count("error") == 2
    assert commands.count("warning") == 2
    assert not [line for line in lines if "::error::e" in line and line.startswith("::error::e")]
