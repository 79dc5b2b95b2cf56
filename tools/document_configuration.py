"""Write config.yaml and docs/configuration.md from the schema.

Run it as ``python tools/document_configuration.py``. config.yaml holds every key with its default,
unit and meaning; a test keeps both files and the schema together.
"""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

from kinacc.config.schema import Key, Section, settings
from kinacc.config.validate import ROBOT, SERIES

_WIDTH = 100
_HEAD = """\
# The paper's study: every value with its unit.
#
# Top-level sections are defaults of every data set; a data set under `datasets` may give any of
# them anew. Further files add data sets:
#     snakemake -c2 --configfile config.yaml examples/ur10.yaml
# Written from the schema by `python tools/document_configuration.py`; the test of the configuration
# fails when the two drift apart. Settings of your own go into a file of your own, given after
# this one, where they replace what stands here.
"""
_DATASETS = """\
# Data sets by name (letters, digits, _ and -); results go to results/<name>/.
datasets:
  mh180: # the synthetic arm of the paper
    robot: mh180 # a shipped robot (docs/robots.md) or the path of a robot file
    measurements:
      source: synthetic
"""
_ALONE = "Keys of an entry under `datasets` that the top level has not ([series](history.md))."
_TABLE_HEAD = """\
# Configuration

Every key of `config.yaml`. Top-level sections are defaults of every data set; an entry under
`datasets:` gives its `robot` and may give any section anew, key by key. Numbers are in the unit the
name carries. Files given after `--configfile` are merged in order.

Written from the schema by `python tools/document_configuration.py`.
"""


def config_yaml() -> str:
    """The text of config.yaml."""
    lines = [_HEAD, _DATASETS]
    for entry in settings().entries:
        lines.append("\n".join(_entry(entry, "")) + "\n")
    return "\n".join(lines)


def configuration_markdown() -> str:
    """The text of docs/configuration.md: one table per section."""
    alone = Section("", "", (ROBOT, SERIES))
    parts = [_TABLE_HEAD, *_table("A data set alone", _ALONE, alone, "")]
    parts += _table("Top level", "", settings(), "")
    for entry in settings().entries:
        if isinstance(entry, Section):
            parts += _section_tables(entry, entry.name)
        elif entry.variants:
            parts += _variants(entry)
    return "\n".join(parts)


def _entry(entry: Key | Section, indent: str) -> list[str]:
    if isinstance(entry, Section):
        lines = [f"{indent}# {entry.about}", f"{indent}{entry.name}:"]
        for each in entry.entries:
            lines += _entry(each, indent + "  ")
        return lines
    note = _note(entry)
    line = f"{indent}{entry.name}: {yaml_value(entry.default)}"
    if len(line) + len(note) + 3 <= _WIDTH:
        return [f"{line} # {note}"]
    comment = textwrap.wrap(note, _WIDTH - len(indent) - 2)
    return [*(f"{indent}# {each}" for each in comment), line]


def _note(key: Key) -> str:
    unit = f"[{key.unit}] " if key.unit else ""
    words = (
        f" ({' | '.join(map(_word, key.choices))})"
        if key.choices and key.kind not in ("names", "parameters", "rows")
        else ""
    )
    return f"{unit}{key.about}{words}"


def _word(choice: str) -> str:
    return choice if choice.strip() and choice not in ",;." else repr(choice)


def yaml_value(value: Any) -> str:
    """A default value as it is written in config.yaml."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, str):
        return value if value and value[0].isalpha() else f'"{value}"'
    if isinstance(value, list):
        return "[" + ", ".join(yaml_value(each) for each in value) + "]"
    if isinstance(value, float) and "e" in repr(value):
        mantissa, _, exponent = repr(value).partition("e")
        return f"{mantissa if '.' in mantissa else mantissa + '.0'}e{exponent}"
    return str(value)


def _section_tables(section: Section, path: str) -> list[str]:
    parts = _table(f"`{path}`", section.about, section, path)
    for entry in section.entries:
        if isinstance(entry, Section):
            parts += _section_tables(entry, f"{path}.{entry.name}")
    return parts


def _variants(key: Key) -> list[str]:
    """The kinds of mappings that a list may hold, and the figures that they may name."""
    kinds = ", ".join(f"`{each.name}`" for each in key.variants)
    what = f"{key.about[0].upper()}{key.about[1:]}"
    about = f"{what}: a list of mappings, each of the kind that one of {kinds} tells."
    parts = _table(f"`{key.name}`", about, Section(key.name, "", key.fields), key.name)
    figures: dict[str, tuple[str, str, str]] = {}
    for kind in key.variants:
        parts += _table(f"`{key.name}`, with `{kind.name}`", kind.about, kind, kind.name)
        figures |= {m[0]: m for e in kind.entries if isinstance(e, Key) for m in e.meanings}
    rows = [f"| `{name}` | {unit} | {about} |" for name, unit, about in figures.values()]
    head = [f"## `{key.name}`: figures that may be named", "", "| figure | unit | meaning |"]
    return [*parts, *head, "|---|---|---|", *rows, ""]


def _table(title: str, about: str, section: Section, path: str) -> list[str]:
    keys = [entry for entry in section.entries if isinstance(entry, Key)]
    head = [f"## {title}", "", about, ""] if about else [f"## {title}", ""]
    if not keys:
        return head
    rows = [
        f"| `{key.name}` | {_default(key)} | {key.unit or '-'} | {_allowed(key)} | {key.about} |"
        for key in keys
    ]
    return [
        *head,
        "| key | default | unit | allowed | meaning |",
        "|---|---|---|---|---|",
        *rows,
        "",
    ]


def _default(key: Key) -> str:
    return "to be given" if key.needed else f"`{yaml_value(key.default)}`"


def _allowed(key: Key) -> str:
    return "a figure, see below" if key.meanings else key.allowed


def main() -> None:
    """Rewrite both files of the repository the package lies in."""
    root = Path(__file__).parents[1]
    (root / "config.yaml").write_text(config_yaml(), encoding="utf-8")
    (root / "docs").mkdir(exist_ok=True)
    (root / "docs" / "configuration.md").write_text(configuration_markdown(), encoding="utf-8")


if __name__ == "__main__":
    main()
