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

from kinacc.cli.group import main
from kinacc.config.load import load
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import as_yaml

ROOT = Path(__file__).parents[1]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
PLACE = re.compile(r"`((?:src|tests|tools|workflow|docs|examples|benchmarks)/[\w./-]+)`")
MODULE = re.compile(r"\bkinacc(?:\.[a-z_]\w*)+")
LINK = re.compile(r"\]\(([^)#\s]+)")
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
SHOWN = re.compile(r"^(?:\$ )?kinacc ([a-z][^\n]*)", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page):
    inside = [link for link in LINK.findall(page.read_text()) if "://" not in link]
    assert [link for link in inside if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_are_named_are_there(page):
    assert [place for place in PLACE.findall(page.read_text()) if not (ROOT / place).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_modules_that_are_named_are_there(page):
    missing = []
    for name in set(MODULE.findall(page.read_text())):
        module, place = name, ROOT / "src" / Path(*name.split("."))
        if not (place.is_dir() or place.with_suffix(".py").is_file()):
            module, _, attribute = name.rpartition(".")
            if not hasattr(importlib.import_module(module), attribute):
                missing.append(name)
    assert missing == []


def shown_commands(page: Path) -> list[list[str]]:
    """Words of the command lines in a page's blocks, continued lines joined."""
    found = BLOCK.findall(page.read_text())
    blocks = "\n".join(text for kind, text in found if kind in ("console", "sh")).replace(
        "\\\n", " "
    )
    return [shlex.split(line, comments=True) for line in SHOWN.findall(blocks)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_are_there_and_take_what_is_shown(page):
    for words in shown_commands(page):
        command, above = main, click.Context(main, **main.context_settings)
        while isinstance(command, click.Group):
            command = command.get_command(above, words[0])
            assert command is not None, words
            words = words[1:]
        if "--help" in words:
            continue
        with above:
            command.make_context(command.name, list(words), parent=above)


def test_links_to_a_part_of_a_page_lead_there():
    def anchors(page: Path) -> set[str]:
        headings = re.findall(r"^#+ (.*)", page.read_text(), re.MULTILINE)
        return {re.sub(r"[^\w -]", "", each.lower()).replace(" ", "-") for each in headings}

    missing = []
    for page in PAGES:
        for link, part in re.findall(r"\]\(([^)#\s:]*)#([^)\s]+)\)", page.read_text()):
            if part not in anchors(page.parent / link if link else page):
                missing.append((page.name, link, part))
    assert missing == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_settings_that_are_shown_are_settings(page, tmp_path):
    for number, (kind, text) in enumerate(BLOCK.findall(page.read_text())):
        shown = yaml.safe_load(text) if kind == "yaml" else {}
        if not {"datasets", "calibration"} & set(shown):
            continue
        arms = {name: {"robot": "ur10"} for name in shown.get("datasets", {"arm": {}})}
        base, given = tmp_path / f"{number}.base.yaml", tmp_path / f"{number}.yaml"
        base.write_text(yaml.safe_dump({"datasets": arms}))
        given.write_text(text)
        for each in shown.get("datasets", {}).values():
            if each.get("robot", "").endswith(".yaml"):
                (tmp_path / each["robot"]).write_text(as_yaml(robots.load("ur10")))
        load([base, given])


def test_every_page_stands_in_the_contents_of_the_site():
    text = (ROOT / "docs" / "index.md").read_text()
    found = re.findall(r"^- \[[^]]*\]\(([^)#]+\.md)\)", text, re.MULTILINE)
    listed = {(ROOT / "docs" / each).resolve() for each in found}
    pages = {*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md")} - {ROOT / "docs" / "index.md"}
    assert {page.name for page in pages - listed if "_build" not in page.parts} == set()


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
