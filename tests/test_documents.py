"""README and docs: links lead somewhere, commands and the options shown with them exist."""

from __future__ import annotations

import importlib
import inspect
import re
import shlex
from pathlib import Path

import click
import pytest
import yaml
from page_blocks import blocks
from shared_data import ROOT

from kinacc.checks.configuration import load
from kinacc.cli.group import main

PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
every_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
PLACE = re.compile(r"`((?:src|tests|tools|workflow|docs|examples|benchmarks)/[\w./-]+)`")
MODULE = re.compile(r"\bkinacc(?:\.[a-z_]\w*)+")
LINK = re.compile(r"\]\(([^)#\s]+)")
SHOWN = re.compile(r"^(?:\$ )?kinacc ([a-z][^\n]*)", re.MULTILINE)


@every_page
def test_links_lead_to_files(page):
    inside = [link for link in LINK.findall(page.read_text()) if "://" not in link]
    assert [link for link in inside if not (page.parent / link).exists()] == []


@every_page
def test_files_that_are_named_are_there(page):
    assert [place for place in PLACE.findall(page.read_text()) if not (ROOT / place).exists()] == []


@every_page
def test_modules_that_are_named_are_there(page):
    missing = []
    for name in set(MODULE.findall(page.read_text())):
        module, place = name, ROOT / "src" / Path(*name.split("."))
        if not (place.is_dir() or place.with_suffix(".py").is_file()):
            module, _, attribute = name.rpartition(".")
            if not hasattr(importlib.import_module(module), attribute):
                missing.append(name)
    assert missing == []


@every_page
def test_commands_are_there_and_take_what_is_shown(page):
    shown = "\n".join(each.text for each in blocks(page) if each.language in ("console", "sh"))
    for line in SHOWN.findall(shown.replace("\\\n", " ")):
        words = shlex.split(line, comments=True)
        command, above = main, click.Context(main, **main.context_settings)
        while isinstance(command, click.Group):
            command = command.get_command(above, words[0])
            assert command is not None, words
            words = words[1:]
        if "--help" in words:
            continue
        with above:
            command.make_context(command.name, list(words), parent=above)


@every_page
def test_settings_that_are_shown_are_settings(page, tmp_path):
    for number, block in enumerate(blocks(page)):
        shown = yaml.safe_load(block.text) if block.language == "yaml" else {}
        if not {"datasets", "calibration"} & set(shown):
            continue
        given, arms = tmp_path / f"{number}.yaml", {}
        given.write_text(block.text)
        for file in ("any.csv", *re.findall(r"path: ([^,}\s]+)", block.text)):
            (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / file).touch()
        for name, each in shown.get("datasets", {"arm": {}}).items():
            file = {} if "series" in each else {"path": str(tmp_path / "any.csv")}
            arms[name] = {"robot": "ur10", "measurements": {"source": "file", "file": file}}
        load([given], {"datasets": arms})


PUBLIC = re.findall(r"^- `(kinacc\.[\w.]+)`$", (ROOT / "docs/api.md").read_text(), re.MULTILINE)


@pytest.mark.parametrize("name", PUBLIC)
def test_what_a_script_imports_has_a_docstring_with_shapes_units_and_errors(name):
    module, _, attribute = name.rpartition(".")
    public = getattr(importlib.import_module(module), attribute)
    text, signature = inspect.getdoc(public), str(inspect.signature(public))
    assert text
    if "np.ndarray" in signature and not getattr(public, "_is_protocol", False):
        assert re.search(r"\(\w+(, [\w +]+)*,?\)", text), "the shape of an array is missing"
        assert re.search(r"\b(mm|rad|mrad)\b|_mm|_rad", text + signature)
    if inspect.isfunction(public) and "InputError" in inspect.getsource(public):
        assert "InputError" in text
