"""The configuration file and its documentation say what the schema says."""

from __future__ import annotations

import re
from pathlib import Path

import document_configuration as document
import pytest
import yaml

from kinacc.config.reading import read
from kinacc.config.schema import NUMERIC, defaults, settings, walk
from kinacc.tables import allowed

ROOT = Path(__file__).parents[2]


def test_config_yaml_is_what_the_schema_says():
    assert (ROOT / "config.yaml").read_text(encoding="utf-8") == document.config_yaml(), (
        "run python tools/document_configuration.py"
    )


def test_the_table_of_keys_is_what_the_schema_says():
    written = (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8")
    assert written == document.configuration_markdown(), (
        "run python tools/document_configuration.py"
    )


def test_config_yaml_reads_as_the_defaults():
    plain = yaml.safe_load(document.config_yaml())
    datasets = plain.pop("datasets")
    assert plain == defaults()
    assert list(datasets) == ["mh180"]


def test_the_reader_agrees_with_plain_yaml():
    for name in ("config.yaml", "examples/ur10.yaml"):
        read_here, problems = read(ROOT / name)
        assert not problems
        assert read_here.data == yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


@pytest.mark.parametrize(("path", "key"), list(walk(settings())), ids=lambda each: str(each)[:40])
def test_every_key_is_documented_and_its_unit_is_in_its_name(path, key):
    assert key.about
    assert key.allowed
    endings = {"mm": "_mm", "kg": "_kg", "deg": "_deg", "mrad": "_mrad", "mm/rad": "_mm_per_rad"}
    endings["s"] = "_s"
    if key.unit and key.name != "joint_range":
        assert f"_{key.name}".endswith(endings[key.unit])
    if key.kind in NUMERIC:
        assert key.low is not None
        assert key.high is not None


def test_words_of_the_readings_are_those_of_the_tables():
    study = settings().entry("study")
    for name, words in (
        ("outlier_rule", allowed.OUTLIER_RULES),
        ("distance", allowed.DISTANCES),
        ("covariance", allowed.COVARIANCES),
        ("search", allowed.SEARCHES),
    ):
        assert study.entry(name).choices == words


def test_every_key_is_used_by_the_package():
    package = ROOT / "src" / "kinacc"
    code = "\n".join(
        path.read_text(encoding="utf-8")
        for path in package.rglob("*.py")
        if "config" not in path.relative_to(package).parts
    )
    unused = [
        ".".join(path)
        for path, key in walk(settings())
        if f'"{key.name}"' not in code and not re.search(rf"^    {key.name}: ", code, re.MULTILINE)
    ]
    # a setting nobody reads would be accepted and change nothing
    assert unused == []
