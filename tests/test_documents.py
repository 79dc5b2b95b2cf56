"""README and docs: links lead somewhere, commands and the options shown with them exist."""

from __future__ import annotations

import importlib
import inspect
import re
import shlex
import tomllib
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
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)  # no reader sees it
SHOWN = re.compile(r"^(?:\$ )?kinacc ([a-z][^\n]*)", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page):
    inside = [link for link in LINK.findall(page.read_text()) if "://" not in link]
    assert [link for link in inside if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_are_named_are_there(page):
    assert [place for place in PLACE.findall(page.read_text()) if not (ROOT / place).exists()] == []


def test_files_of_the_walks_are_where_the_walks_say():
    page = (ROOT / "CONTRIBUTING.md").read_text()
    walks = page.partition("## Three walks")[2].partition("\n## ")[0]
    missing = []
    for step in re.split(r"^\d+\. ", walks, flags=re.MULTILINE)[1:]:
        folder = ROOT
        for name in re.findall(r"`([\w./]+(?:\.py|\.yaml|/))`", step):
            place = ROOT / name if "/" in name else folder / name
            folder = place if name.endswith("/") else place.parent
            if not (place.exists() or (ROOT / name).exists()):
                missing.append(name)
    assert missing == []


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


def test_the_map_of_the_house_names_every_room_in_its_order():
    rooms = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    order = [name.strip() for layer in rooms["contracts"][0]["layers"] for name in layer.split("|")]
    table = (ROOT / "CONTRIBUTING.md").read_text().partition("| room |")[2].partition("\n\n")[0]
    rows = [row.split("|")[1] for row in table.splitlines() if row.startswith("| `")]
    assert [name for row in rows for name in re.findall(r"`(\w+)`", row)] == order


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


# Looked up, never read from top to bottom.
REFERENCE = (
    "artifacts",
    "benchmarks",
    "claims",
    "configuration",
    "reading-the-paper",
)


def test_pages_written_by_hand_are_short_enough_to_be_read():
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    words = {page.name: len(re.sub(COMMENT, "", page.read_text()).split()) for page in pages}
    own = {name: count for name, count in words.items() if name.split(".")[0] not in REFERENCE}
    assert len(own) > 20
    assert {name: count for name, count in own.items() if count >= 1500} == {}


def test_the_readme_begins_with_the_readers_robot_and_says_what_its_models_are_called():
    text = (ROOT / "README.md").read_text()
    assert re.findall(r"^## (.*)", text, re.MULTILINE)[0] == "Your robot"
    for short, long in (("VEC", "volumetric error compensation"), ("DH", "denavit-hartenberg")):
        told = text[: text.lower().index(long)]
        outside = re.sub(r"^```.*?^```", "", told, flags=re.MULTILINE | re.DOTALL)
        assert len(re.findall(rf"\b{short}\b", outside)) <= 1  # the name in front of its meaning


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


def test_pages_that_walk_a_reader_through_show_commands():
    assert len(shown_commands(ROOT / "docs" / "from-tracker-file-to-compensated-robot.md")) > 5


def test_held_out_errors_have_one_name_on_every_page_that_tells_of_them():
    """Tables have their own older names, which the glossary tells once."""
    glossary = ROOT / "docs/glossary.md"
    others = {*PAGES, ROOT / "config.yaml"} - {glossary}
    said = re.compile("cross.valid", re.IGNORECASE)
    assert [page.name for page in others if said.search(page.read_text())] == []
    assert len(said.findall(glossary.read_text())) == 1


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
def test_what_a_script_imports_says_what_it_is_for_its_shapes_and_its_units(name):
    module, _, attribute = name.rpartition(".")
    found = getattr(importlib.import_module(module), attribute)
    told = inspect.getdoc(found)
    assert told
    assert told.splitlines()[0][0].isupper() or told.startswith("``")
    signature = str(inspect.signature(found))
    if "np.ndarray" in signature and not getattr(found, "_is_protocol", False):
        assert re.search(r"\((\w+|\.\.\.)(, [\w +]+)*,?\)", told), "no shape"
        without = ("choose", "order", "distances")  # of any unit: what is given is given back
        assert attribute in without or re.search(r"\b(mm|rad|mrad)\b|_mm|_rad", told + signature)
    if inspect.isfunction(found) and "InputError" in inspect.getsource(found):
        assert "InputError" in told
