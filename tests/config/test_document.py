"""The configuration file and the reference page hold what the models hold."""

from __future__ import annotations

import pytest
import yaml
from shared_data import ROOT

from kinacc.config.gate_rules import KINDS
from kinacc.config.schema import defaults, json_schema
from kinacc.config.settings import Configuration

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
    gates = {kind.title() for kind in KINDS}
    for section, name in KEYS:
        if section not in gates | {"DataSet", "Line", "Link", "Excluded"}:
            assert " ".join(DEFINED[section]["properties"][name]["description"].split()) in told


@pytest.mark.parametrize(("section", "name"), KEYS, ids=".".join)
def test_every_key_is_documented_and_its_unit_is_in_its_name(section, name):
    node = DEFINED[section]["properties"][name]
    assert node["description"]
    unit = node.get("unit", "").replace("/", "_per_")
    assert not unit or name == "joint_range" or f"_{name}".endswith(f"_{unit}")
