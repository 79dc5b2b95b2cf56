"""The configuration's schema: records of what schema.yaml says about every key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

DATASET_NAME = "[A-Za-z0-9_][A-Za-z0-9_-]*"  # with - first it would read as an option
KINDS: tuple[str, ...] = ("int", "float", "bool", "text", "ints", "floats", "texts", "pair")
KINDS += ("pairs", "names", "parameters", "rows", "records", "series", "variants")
NUMERIC = {
    "int": "a whole number",
    "float": "a number",
    "ints": "a list of whole numbers, each",
    "floats": "a list of numbers, each",
    "pair": "two numbers [smaller, larger]",
    "pairs": "a list of pairs [smaller, larger]",
}
_KEY_FIELDS: tuple[str, ...] = ("kind", "default", "unit", "low", "high", "open_ends")
_KEY_FIELDS += ("choices", "length", "behind", "fields", "variants", "nullable", "execution")
_KEY_FIELDS += ("about",)


@dataclass(frozen=True)
class Key:
    """One value of the configuration; the fields are explained at the head of schema.yaml."""

    name: str
    kind: str
    default: Any
    about: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    open_ends: bool = False
    choices: tuple[str, ...] = ()
    behind: tuple[str, ...] = ()
    length: tuple[int, int] = (0, 100_000)
    fields: tuple[Key, ...] = ()
    variants: tuple[Section, ...] = ()
    meanings: tuple[tuple[str, str, str], ...] = ()  # choices with unit and meaning
    nullable: bool = False
    execution: bool = False

    @property
    def needed(self) -> bool:
        """Whether a mapping that has it as a field has to give it."""
        return self.default is None and not self.nullable

    @property
    def allowed(self) -> str:
        """What the key takes, in words."""
        parts = []
        if self.kind == "names":
            parts.append(f"a mapping of {self.names} to text")
        elif self.kind == "parameters":
            names = {"joints": "d, joint 3, joint 3 d", "frames": "base, base rz, tool x"}
            parts.append(
                f"a mapping of names ({names[self.choices[0]]}) to free, fixed or "
                "{value_mm: .., prior_std_mm: ..}, with mm, mrad, rad or deg"
            )
        elif self.kind == "series":
            parts.append(
                "a list of {path: .., date: 2026-03-01, base: same or moved, tool: same or moved}, "
                "base and tool since the one before, the first without"
            )
        elif self.kind == "rows":
            parts.append("a list of {lines: [8, 12], reason: ..}")
        elif self.kind == "texts" and self.choices:
            parts.append("a list of " + ", ".join(self.choices))
        elif self.kind == "records":
            inside = ", ".join(f"{each.name}: {each.allowed}" for each in self.fields)
            parts.append(f"a list of {{{inside}}}")
        elif self.kind == "variants":
            kinds = ", ".join(each.name for each in self.variants)
            parts.append(f"a list of mappings, each with one of {kinds}")
        elif self.choices:
            parts.append(
                ", ".join(repr(word) if not word.strip() else word for word in self.choices)
            )
        elif self.kind in ("text", "texts", "bool"):
            parts.append(
                {"text": "text", "texts": "a list of texts", "bool": "true, false"}[self.kind]
            )
        if self.kind in NUMERIC:
            parts.append(self.numbers)
        if self.nullable:
            parts.append("null")
        return " or ".join(parts)

    @property
    def names(self) -> str:
        """The names a mapping takes, in words."""
        behind = ""
        if self.behind:
            behind = f"; of a target, or of one named before it (mA_{self.behind[0]}), {{}}"
        return ", ".join(self.choices) + (
            behind.format(", ".join(self.behind)) if self.behind else ""
        )

    def takes(self, name: object) -> bool:
        """Whether a mapping takes ``name``."""
        ends = tuple(f"_{word}" for word in self.behind)
        return name in self.choices + self.behind or (
            bool(ends) and isinstance(name, str) and name.endswith(ends)
        )

    @property
    def numbers(self) -> str:
        """The numbers the key takes, in words: kind, limits, unit."""
        unit = f" in {self.unit}" if self.unit else ""
        return f"{NUMERIC[self.kind]}{self._items()}{unit}{self._limits()}"

    def _items(self) -> str:
        fewest, most = self.length
        if self.kind in ("int", "float", "pair") or most >= 100_000:
            return ""
        return f" ({fewest} of them)" if fewest == most else f" ({fewest} to {most} of them)"

    def _limits(self) -> str:
        if self.low is None and self.high is None:
            return ""
        low = "" if self.low is None else f" from {self.low:g}"
        high = "" if self.high is None else f" to {self.high:g}"
        return low + high + (", ends excluded" if self.open_ends else "")


@dataclass(frozen=True)
class Section:
    """A named group of keys and further sections."""

    name: str
    about: str
    entries: tuple[Key | Section, ...]

    def entry(self, name: object) -> Key | Section | None:
        """The key or section of that name, None if there is none."""
        return next((entry for entry in self.entries if entry.name == name), None)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the section's keys and sections, in order."""
        return tuple(entry.name for entry in self.entries)


@cache
def settings() -> Section:
    """Everything a data set can set beside its robot; the top level of the configuration."""
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    text = (Path(__file__).parent / "schema.yaml").read_text(encoding="utf-8")
    return _section("", yaml.load(text, Loader=loader))


def key(path: str) -> Key:
    """The key of a dotted path such as ``study.alpha``."""
    return dict(walk(settings()))[tuple(path.split("."))]


def _section(name: str, content: Mapping[str, Any]) -> Section:
    entries = tuple(
        _key(each, value)
        if "kind" in value and isinstance(value["kind"], str)
        else _section(each, value)
        for each, value in content.items()
        if each != "about"
    )
    return Section(name, content.get("about", ""), entries)


def _key(name: str, content: Mapping[str, Any]) -> Key:
    unknown = set(content) - set(_KEY_FIELDS)
    if unknown or content["kind"] not in KINDS:
        raise ValueError(
            f"schema.yaml, {name}: {sorted(unknown) or content['kind']} not understood"
        )
    fields = dict(content)
    if isinstance(fields.get("choices"), Mapping):
        meant = fields["choices"].items()
        fields["meanings"] = tuple((word, of["unit"], of["about"]) for word, of in meant)
    for each in ("choices", "behind", "length"):
        if each in fields:
            fields[each] = tuple(fields[each])
    if "fields" in fields:
        fields["fields"] = _fields(fields["fields"])
    if "variants" in fields:
        fields["variants"] = tuple(
            Section(kind, of["about"], _fields({k: v for k, v in of.items() if k != "about"}))
            for kind, of in fields["variants"].items()
        )
    return Key(name=name, **fields)


def _fields(inside: Mapping[str, Mapping[str, Any]]) -> tuple[Key, ...]:
    """Keys of a mapping that stands in a list."""
    blank = {"default": None, "about": ""}
    return tuple(_key(each, {**blank, **content}) for each, content in inside.items())


def walk(section: Section, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Key]]:
    """Every key below a section with its path."""
    for entry in section.entries:
        here = (*path, entry.name)
        if isinstance(entry, Section):
            yield from walk(entry, here)
        else:
            yield here, entry


def defaults(section: Section | None = None) -> dict[str, Any]:
    """Default values of a section (all settings if none) as nested dictionaries and lists."""
    return {
        entry.name: defaults(entry) if isinstance(entry, Section) else plain(entry.default)
        for entry in (section or settings()).entries
    }


def without_execution_keys(
    values: Mapping[str, Any], section: Section | None = None
) -> dict[str, Any]:
    """Settings without the keys that change only how a run is carried out, for hashing.

    ``values`` may be any part of the settings that starts at the top level (or at ``section``).
    """
    section = section or settings()
    kept: dict[str, Any] = {}
    for name, value in values.items():
        entry = section.entry(name)
        if isinstance(entry, Section) and isinstance(value, Mapping):
            kept[name] = without_execution_keys(value, entry)
        elif not (isinstance(entry, Key) and entry.execution):
            kept[name] = value
    return kept


def plain(value: Any) -> Any:
    """A copy in plain dictionaries and lists, all the way down."""
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, (list, tuple)) else value
