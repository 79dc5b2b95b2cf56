"""The configuration file and the reference page hold what the models hold."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from kinacc.config.gate_rules import KINDS
from kinacc.config.reading import read
from kinacc.config.schema import defaults, json_schema
from kinacc.config.settings import Configuration
from kinacc.tables import allowed as words_of_tables

ROOT = Path(__file__).parents[2]
DEFINED = json_schema(Configuration)["$defs"]
KEYS = [
    (section, name)
    for section, content in DEFINED.items()
    for name, node in content["properties"].items()
    if "description" in node and "$ref" not in node
]


def test_config_yaml_states_every_default_and_its_meaning():
    text = (ROOT / "config.yaml").read_text(encoding="utf-8")
    plain = yaml.safe_load(text)
    assert list(plain.pop("datasets")) == ["mh180"]
    assert plain == defaults()
    told = " ".join(text.replace("#", " ").split())
    gates = {kind.__name__ for kind in KINDS.values()}
    for section, name in KEYS:
        if section not in gates | {"DataSet", "Line", "Link", "Excluded"}:
            assert " ".join(DEFINED[section]["properties"][name]["description"].split()) in told


def test_the_reader_agrees_with_plain_yaml():
    for name in ("config.yaml", "examples/ur10.yaml"):
        read_here, problems = read(ROOT / name)
        assert not problems
        assert read_here.data == yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


@pytest.mark.parametrize(("section", "name"), KEYS, ids=".".join)
def test_every_key_is_documented_and_its_unit_is_in_its_name(section, name):
    node = DEFINED[section]["properties"][name]
    assert node["description"]
    unit = node.get("unit", "").replace("/", "_per_")
    assert not unit or name == "joint_range" or f"_{name}".endswith(f"_{unit}")


def test_words_of_the_readings_are_those_of_the_tables():
    study = DEFINED["Study"]["properties"]
    for name in ("outlier_rule", "distance", "covariance", "search"):
        words = {"search": "SEARCHES"}.get(name, f"{name.upper()}S")
        assert tuple(study[name]["enum"]) == getattr(words_of_tables, words)


def test_every_key_is_used_by_the_package():
    package = ROOT / "src" / "kinacc"
    code = "\n".join(
        path.read_text(encoding="utf-8")
        for path in package.rglob("*.py")
        if "config" not in path.relative_to(package).parts
    )
    gates = {kind.__name__ for kind in KINDS.values()}
    # a setting nobody reads would be accepted and change nothing
    assert [
        name
        for section, name in KEYS
        if section not in gates
        and not re.search(rf'"{name}"|\.{name}\b|^    {name}: ', code, re.MULTILINE)
    ] == []
