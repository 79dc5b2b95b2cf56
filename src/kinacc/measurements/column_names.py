"""What a column's name says: its words, its unit, and what its numbers are.

The words stand in ``words.yaml``, in small letters without accents.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection
from dataclasses import dataclass

from kinacc.measurements.words import WORDS

# What the numbers of a column are, by a word of its name.
MEASURED = "measured"
REPORTED = "reported"  # read back, where there are commands; measured, where there is a nominal
PLAIN = "plain"  # no word says
OPEN = "open"  # a word that means one thing here and another there
CALCULATED = "calculated by the controller"
NOMINAL = "nominal"
DEVIATION = "a deviation"
SPREAD = "an uncertainty"
OTHER = "another quantity"

_ROLE = {word: role for role, words in WORDS["roles"].items() for word in words}
_COMMANDS = WORDS["roles"][NOMINAL] | WORDS["commands"]
# Types of RAPID: what a value is written as, and not whether it was wanted or measured.
_TYPES = frozenset(("jointtarget", "robtarget"))
_LETTERS_ALONE = {"d": DEVIATION, "δ": DEVIATION, "u": SPREAD, "σ": SPREAD}
_OPEN_ALONE = frozenset("esvtnm")

UNITS = {word: unit for unit, words in WORDS["units"].items() for word in words}
KNOWN = frozenset((*UNITS, *UNITS.values())) - {"?"}
_ONLY_LAST = ("m", "c", "turn", "count", "nm")  # words of another meaning elsewhere
_BRACKET = re.compile(r"[\[({<]\s*([^\[({<\])}>]*?)\s*[\])}>]")
_WORD = re.compile(r"°[CFcf]?(?![^\W\d_])|[^\W\d_]+|\d+")
_HUMP = re.compile(
    r"(?<=[a-zà-öø-ÿ]{2})(?=[A-ZÀ-ÖØ-Þ])|(?<=[A-ZÀ-ÖØ-Þ])(?=[A-ZÀ-ÖØ-Þ][a-zà-öø-ÿ]{2})"
)
_SIGNS = str.maketrans({"º": "°", "˚": "°", "∆": "Δ", "µ": "μ", "ß": "ss"})
_NO_UNIT = "-/ ?\ufffd"  # no more is left of a degree sign in the wrong encoding
_AXIS = re.compile(r"(?:rv|r|q)?[xyzw]|q|j")
_COVERAGE = re.compile(r"(?<![^\W_])k\s*=\s*([123])(?!\d|[.,]\d)", re.IGNORECASE)  # (k=2)
_T_MAC = re.compile(r"t-mac", re.IGNORECASE)
_JOINED = re.compile(r"(.{1,4}?)(mm|deg|rad|grad|cm|um|μm)")
_JAPANESE = re.compile("|".join(sorted(WORDS["japanese"], key=len, reverse=True)))
_WIDE = {code: code - 0xFEE0 for code in range(0xFF01, 0xFF5F)} | {0x3000: " "}


@dataclass(frozen=True)
class Name:
    """A column's name taken apart: ``words`` in small letters, ``unit`` or empty.

    ``unit`` is as the file writes it where it is not known. ``spelled`` are the words as the file
    writes them. ``coverage``: the k of an uncertainty, 0 where none is said.
    """

    column: str
    words: tuple[str, ...]
    unit: str
    spelled: tuple[str, ...] = ()
    coverage: int = 0

    def without(self, place: int) -> tuple[str, ...]:
        """The words but the one at ``place``."""
        return self.words[:place] + self.words[place + 1 :]


def name_of(column: str, unit: str = "") -> Name:
    """The name taken apart; ``unit`` is what a line of units says of it."""
    covered = _COVERAGE.search(f"{column} {unit}")
    stated = [unit_of(_COVERAGE.sub("", unit))]
    text = _T_MAC.sub("tmac", _in_english(_COVERAGE.sub("", column)).translate(_SIGNS))

    def put_aside(bracket: re.Match[str]) -> str:
        if _says_more(bracket[1]):
            return bracket[0]
        stated.append(unit_of(bracket[1]))
        return " "

    text = _BRACKET.sub(put_aside, text)
    words = [pair for part in _HUMP.split(text) for each in _WORD.findall(part)
             for pair in _parted(each)]  # fmt: skip
    kept = []
    for place, (word, spelled) in enumerate(words):
        last = place == len(words) - 1 and place > 0
        named = UNITS.get(word, "")
        if word == "in":
            stated += ["inch"] if last and not any(stated) else []
        elif named and (last or word not in _ONLY_LAST) and named != "C" and len(words) > 1:
            stated.append(spelled if named == "?" else named)
        else:
            kept.append((word, spelled))
    return Name(
        column,
        tuple(word for word, _ in kept),
        " or ".join(dict.fromkeys(filter(None, stated))),
        tuple(spelled for _, spelled in kept),
        int(covered[1]) if covered else 0,
    )


def unit_of(text: str) -> str:
    """The unit a cell such as [mm] or deg states, as the file writes it where it is not known."""
    text = _in_english(text)
    inside = _BRACKET.search(text)
    word = (inside[1] if inside else text).strip()
    if not word.strip(_NO_UNIT):
        return ""
    named = "inch" if plain(word) == "in" else UNITS.get(plain(word), "")
    return named if named not in ("", "?") else word


def plain(word: str) -> str:
    """A word in small letters without accents."""
    apart = unicodedata.normalize("NFKD", word.translate(_SIGNS))
    return "".join(each for each in apart if not unicodedata.combining(each)).lower()


def _in_english(text: str) -> str:
    """The text with known Japanese words in English, and full-width signs as ordinary ones."""
    if text.isascii():
        return text
    english = WORDS["japanese"]
    return _JAPANESE.sub(lambda found: f" {english[found[0]]} ", text.translate(_WIDE))


def _says_more(inside: str) -> bool:
    """Whether what stands in brackets is an index, an axis or a word such as Actual, no unit."""
    words = [plain(word) for word in _WORD.findall(inside)]
    known = [w.isdigit() or w in _ROLE or _AXIS.fullmatch(w) for w in words]
    return not inside or (bool(words) and all(known) and plain(inside) not in UNITS)


def _parted(spelled: str) -> list[tuple[str, str]]:
    """A word, parted where an axis is written together with what it is: dX, Xsoll, rxdeg."""
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
        told = stem if stem in _ROLE or stem in WORDS["place"] else WORDS["letters"].get(stem, "")
        if _AXIS.fullmatch(tail) and told:
            return [(told, spelled[:-size]), (tail, spelled[-size:])]
        if _AXIS.fullmatch(head) and word[size:] in _ROLE and len(word) > size + 1:
            return [(head, spelled[:size]), (word[size:], spelled[size:])]
    return [(word, spelled)]


def role(words: Collection[str]) -> str:
    """What the words say the numbers are; ``PLAIN`` where none of them speaks."""
    said = {_ROLE.get(word, _LETTERS_ALONE.get(word)) for word in words} - {None}
    # "position error" is no position, "std dev" no deviation.
    for each in (OTHER, SPREAD, DEVIATION):
        if each in said:
            return each
    if MEASURED in said:
        said = {_ROLE.get(word) for word in words if word not in _TYPES}
        return OPEN if {NOMINAL, CALCULATED} & said else MEASURED
    if NOMINAL in said:
        return OPEN if REPORTED in said else NOMINAL
    if CALCULATED in said:
        return CALCULATED
    if REPORTED in said:
        # The controller's own forward kinematics: actual_TCP_pose.
        return CALCULATED if WORDS["frame"] & set(words) else OPEN if OPEN in said else REPORTED
    return OPEN if OPEN in said or _OPEN_ALONE & set(words) else PLAIN


def speaks(word: str) -> bool:
    """Whether a word says what numbers are, and so is no part of a target's name."""
    return word in _ROLE and word not in WORDS["reflectors"] | WORDS["frame"]


def commands(words: Collection[str]) -> bool:
    """Whether words of joints say that these were commanded."""
    return role(words) in (NOMINAL, OPEN) and bool(_COMMANDS & set(words))


def is_own_pose(words: Collection[str]) -> bool:
    """Whether the words are those of a pose that the controller calculates from its joints."""
    return bool(WORDS["frame"] & set(words)) and REPORTED in map(_ROLE.get, words)


def is_frame(words: Collection[str]) -> bool:
    """Whether the words are what the tool centre point is called, and nothing else."""
    return bool(words) and set(words) <= WORDS["frame"]
