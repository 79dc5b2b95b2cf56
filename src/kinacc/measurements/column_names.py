"""The meaning of a column's name: its terms, its unit, and whether its numbers were measured.

The vocabulary is ``words.yaml``, in small letters without accents.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import yaml


def _sets(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _sets(entry) for key, entry in value.items()}
    return frozenset(value.split()) if isinstance(value, str) else value


_PLAIN = yaml.load(
    files(__package__).joinpath("words.yaml").read_text(encoding="utf-8"),
    Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader),  # noqa: S506
)
# A folded text is a set of words, a list and a mapping stay as they are.
WORDS: dict[str, Any] = {
    key: value if key in ("letters", "japanese") else _sets(value) for key, value in _PLAIN.items()
}

# What the numbers of a column are, by a term of its name.
MEASURED = "measured"
REPORTED = "reported"  # read back, where there are commands; measured, where there is a nominal
PLAIN = "plain"  # no term decides
OPEN = "open"  # a term with more than one meaning
CALCULATED = "calculated by the controller"
NOMINAL = "nominal"
DEVIATION = "a deviation"
SPREAD = "an uncertainty"
OTHER = "another quantity"

_ROLE = {word: role for role, terms in WORDS["roles"].items() for word in terms}
COMMANDS = WORDS["roles"][NOMINAL] | WORDS["commands"]
# Types of RAPID: how a value is written, not whether it was wanted or measured.
_TYPES = frozenset(("jointtarget", "robtarget"))
_LETTERS_ALONE = {"d": DEVIATION, "δ": DEVIATION, "u": SPREAD, "σ": SPREAD}
_OPEN_ALONE = frozenset("esvtnm")

UNITS = {word: unit for unit, terms in WORDS["units"].items() for word in terms}
KNOWN = frozenset((*UNITS, *UNITS.values())) - {"?"}
_ONLY_LAST = ("m", "c", "turn", "count", "nm")  # words of another meaning elsewhere
_BRACKET = re.compile(r"[\[({<]\s*([^\[({<\])}>]*?)\s*[\])}>]")
_WORD = re.compile(r"°[CFcf]?(?![^\W\d_])|[^\W\d_]+|\d+")
_HUMP = re.compile(
    r"(?<=[a-zà-öø-ÿ]{2})(?=[A-ZÀ-ÖØ-Þ])|(?<=[A-ZÀ-ÖØ-Þ])(?=[A-ZÀ-ÖØ-Þ][a-zà-öø-ÿ]{2})"
)
_SIGNS = str.maketrans({"º": "°", "˚": "°", "∆": "Δ", "µ": "μ", "ß": "ss"})
_NO_UNIT = "-/ ?\ufffd"  # no more remains of a degree sign in the wrong encoding
_AXIS = re.compile(r"(?:rv|r|q)?[xyzw]|q|j")
_COVERAGE = re.compile(r"(?<![^\W_])k\s*=\s*([123])(?!\d|[.,]\d)", re.IGNORECASE)  # (k=2)
# u(X) is the standard uncertainty of X, U(X) an expanded one.
_OF_AXIS = re.compile(r"(?<![^\W_])([uU])\s*\(\s*((?:[Rr][Vv]?)?[XYZxyz])\s*\)")
_JOINED = re.compile(r"(.{1,4}?)(mm|deg|rad|grad|cm|um|μm)")
_JAPANESE = re.compile("|".join(sorted(WORDS["japanese"], key=len, reverse=True)))
_WIDE = {code: code - 0xFEE0 for code in range(0xFF01, 0xFF5F)} | {0x3000: " "}


@dataclass(frozen=True)
class Name:
    """A column's name taken apart: ``terms`` in small letters, ``unit`` or empty.

    ``unit`` is as the file writes it where it is not known. ``spelled`` are the terms as the file
    writes them. ``coverage``: the k of an uncertainty, 0 where none is stated.
    """

    column: str
    terms: tuple[str, ...]
    unit: str
    spelled: tuple[str, ...] = ()
    coverage: int = 0


def name_of(column: str, unit: str = "") -> Name:
    """The name taken apart; ``unit`` is that of a line of units."""
    covered = _COVERAGE.search(f"{column} {unit}")
    stated = [unit_of(_COVERAGE.sub("", unit))]
    of_axis = _OF_AXIS.search(column)
    coverage = int(covered[1]) if covered else int(of_axis is not None and of_axis[1] == "u")
    text = _OF_AXIS.sub(r"\1\2", _COVERAGE.sub("", column))
    text = _in_english(text).translate(_SIGNS)
    text = re.sub("t-mac", "tmac", text, flags=re.IGNORECASE)

    def put_aside(bracket: re.Match[str]) -> str:
        inside = bracket[1]
        parts = [plain(word) for word in _WORD.findall(inside)]
        known = [p.isdigit() or p in _ROLE or _AXIS.fullmatch(p) for p in parts]
        if not inside or (parts and all(known) and plain(inside) not in UNITS):
            return bracket[0]  # an index, an axis or a word such as Actual
        stated.append(unit_of(inside))
        return " "

    text = _BRACKET.sub(put_aside, text)
    pairs = [pair for part in _HUMP.split(text) for word in _WORD.findall(part)
             for pair in _parted(word)]  # fmt: skip
    terms = []
    for place, (word, spelled) in enumerate(pairs):
        last = place == len(pairs) - 1 and place > 0
        unit_name = UNITS.get(word, "")
        if word == "in":
            stated += ["inch"] if last and not any(stated) else []
        elif unit_name and (last or word not in _ONLY_LAST) and unit_name != "C" and len(pairs) > 1:
            stated.append(spelled if unit_name == "?" else unit_name)
        else:
            terms.append((word, spelled))
    return Name(
        column,
        tuple(word for word, _ in terms),
        " or ".join(dict.fromkeys(filter(None, stated))),
        tuple(spelled for _, spelled in terms),
        coverage,
    )


def unit_of(text: str) -> str:
    """The unit that a cell such as [mm] or deg states, as written where it is not known."""
    text = _in_english(text)
    inside = _BRACKET.search(text)
    word = (inside[1] if inside else text).strip()
    if not word.strip(_NO_UNIT):
        return ""
    unit = "inch" if plain(word) == "in" else UNITS.get(plain(word), "")
    return unit if unit not in ("", "?") else word


def plain(word: str) -> str:
    """A word in small letters without accents."""
    apart = unicodedata.normalize("NFKD", word.translate(_SIGNS))
    return "".join(letter for letter in apart if not unicodedata.combining(letter)).lower()


def _in_english(text: str) -> str:
    """The text with known Japanese words in English, and full-width signs as ordinary ones."""
    if text.isascii():
        return text
    english = WORDS["japanese"]
    return _JAPANESE.sub(lambda match: f" {english[match[0]]} ", text.translate(_WIDE))


def _parted(spelled: str) -> list[tuple[str, str]]:
    """A word, parted where an axis is written together with its meaning: dX, Xsoll, rxdeg."""
    word = plain(spelled)
    if not word:  # an accent alone
        return []
    if word in _ROLE or word in UNITS or word in _TYPES:
        return [(word, spelled)]
    if (joined := _JOINED.fullmatch(word)) and _AXIS.fullmatch(joined[1]):
        return [(joined[1], spelled[: len(joined[1])]), (joined[2], joined[2])]
    for cut in range(3, len(word) - 2):
        parts = (word[:cut], word[cut:])
        if any(a in _ROLE and b in WORDS["beside"] for a, b in (parts, parts[::-1])):
            return [(parts[0], spelled[:cut]), (parts[1], spelled[cut:])]
    for size in (3, 2, 1):
        stem, head, tail = word[:-size], word[:size], word[-size:]
        known = stem if stem in _ROLE or stem in WORDS["place"] else WORDS["letters"].get(stem, "")
        if _AXIS.fullmatch(tail) and known:
            return [(known, spelled[:-size]), (tail, spelled[-size:])]
        if _AXIS.fullmatch(head) and word[size:] in _ROLE and len(word) > size + 1:
            return [(head, spelled[:size]), (word[size:], spelled[size:])]
    return [(word, spelled)]


def role(terms: Collection[str]) -> str:
    """What the numbers are by the terms; ``PLAIN`` where none of them decides."""
    roles = {_ROLE.get(term, _LETTERS_ALONE.get(term)) for term in terms} - {None}
    # "position error" is no position, "std dev" no deviation.
    for first in (OTHER, SPREAD, DEVIATION):
        if first in roles:
            return first
    if MEASURED in roles:
        roles = {_ROLE.get(term) for term in terms if term not in _TYPES}
        return OPEN if {NOMINAL, CALCULATED} & roles else MEASURED
    if NOMINAL in roles:
        return OPEN if REPORTED in roles else NOMINAL
    if CALCULATED in roles:
        return CALCULATED
    if REPORTED in roles:
        # The controller's own forward kinematics: actual_TCP_pose.
        return CALCULATED if WORDS["frame"] & {*terms} else OPEN if OPEN in roles else REPORTED
    return OPEN if OPEN in roles or _OPEN_ALONE & {*terms} else PLAIN


def decides(term: str) -> bool:
    """Whether a term is about the role of numbers, and so is no part of a target's name."""
    return term in _ROLE and term not in WORDS["reflectors"] | WORDS["frame"]


def is_controller_pose(terms: Collection[str]) -> bool:
    """Whether the terms are those of a pose that the controller calculates from its joints."""
    return bool(WORDS["frame"] & {*terms}) and REPORTED in map(_ROLE.get, terms)
