"""What a column's name says: its words and its unit."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from kinacc.measurements.roles import LETTERS, WORDS

UNITS = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "grad", "grados", "gradi", "°"), "deg"),
    **dict.fromkeys(("degre", "degres", "grado", "grau", "graus"), "deg"),
    **dict.fromkeys(("rad", "rads", "radian", "radians", "radianten", "radianes"), "rad"),
    **dict.fromkeys(("radianti", "radiani", "bogenmass"), "rad"),
    **dict.fromkeys(("mm", "millimeter", "millimetre", "millimeters", "millimetres"), "mm"),
    **dict.fromkeys(("milimetros", "millimetri"), "mm"),
    **dict.fromkeys(("m", "meter", "metre", "meters", "metres", "metros", "metri"), "m"),
    **dict.fromkeys(("c", "°c", "celsius"), "C"),
    **dict.fromkeys(("kg", "kgs", "kilogram", "kilograms", "kilogramm", "kilogramme"), "kg"),
    # Known, and read by nothing: who states them must not be taken for someone who states none.
    **dict.fromkeys(("cm", "centimeter", "centimetre"), "cm"),
    **dict.fromkeys(("um", "μm", "micron", "microns", "micrometer", "micrometre"), "µm"),
    **dict.fromkeys(("inch", "inches", "zoll"), "inch"),
    **dict.fromkeys(("mrad", "urad", "μrad", "gon", "mdeg", "arcmin", "arcsec"), "?"),
    **dict.fromkeys(("rev", "revs", "turn", "turns", "count", "counts", "tick", "ticks"), "?"),
    **dict.fromkeys(("pulse", "pulses", "nm", "dm", "km", "feet", "mil", "mils", "°f"), "?"),
}
READ = ("deg", "rad", "mm", "m", "C", "kg")  # units that are read
KNOWN = frozenset((*UNITS, *UNITS.values())) - {"?"}
_ONLY_LAST = ("m", "c", "turn", "count", "nm")  # words of another meaning elsewhere
_BRACKET = re.compile(r"[\[({<]\s*([^\[({<\])}>]*?)\s*[\])}>]")
_WORD = re.compile(r"°[CFcf]?(?![^\W\d_])|[^\W\d_]+|\d+")
_HUMP = re.compile(
    r"(?<=[a-zà-öø-ÿ]{2})(?=[A-ZÀ-ÖØ-Þ])|(?<=[A-ZÀ-ÖØ-Þ])(?=[A-ZÀ-ÖØ-Þ][a-zà-öø-ÿ]{2})"
)
_SIGNS = str.maketrans({"º": "°", "˚": "°", "∆": "Δ", "µ": "μ", "ß": "ss"})
_AXIS = re.compile(r"(?:r|q)?[xyzw]|q|j")
_T_MAC = re.compile(r"t-mac", re.IGNORECASE)
_JOINED = re.compile(r"(.{1,4}?)(mm|deg|rad|grad|cm|um|μm)")
_PLACE_TEXT = "pos position rot rotation quat ori trans tool euler"
_BESIDE_TEXT = """
wert werte winkel position pos lage punkt koordinate koordinaten joint axis achse achsen gelenk
angle rot rotation orientierung drehung value val tcp pose quat
"""
_WORDS_OF_PLACE = frozenset(_PLACE_TEXT.split())
# What a word that speaks is written together with: Sollwinkel, jointcmd.
_BESIDE = frozenset(_BESIDE_TEXT.split())


@dataclass(frozen=True)
class Name:
    """A column's name taken apart: ``words`` in small letters, ``unit`` or empty.

    ``unit`` is one of ``READ``, or as the file writes it where it is none of them. ``spelled`` are
    the words as the file writes them.
    """

    column: str
    words: tuple[str, ...]
    unit: str
    spelled: tuple[str, ...] = ()

    def without(self, place: int) -> tuple[str, ...]:
        """The words but the one at ``place``."""
        return self.words[:place] + self.words[place + 1 :]


def name_of(column: str, unit: str = "") -> Name:
    """The name taken apart; ``unit`` is what a line of units says of it."""
    stated = [unit_of(unit)] if unit_of(unit) else []
    text = _T_MAC.sub("tmac", column.translate(_SIGNS))
    for inside in _BRACKET.findall(text):
        if _says_more(inside):
            continue
        stated += [unit_of(inside)] if unit_of(inside) else []
        text = text.replace(inside, " ", 1)
    words: list[tuple[str, str]] = []
    for part in _HUMP.split(text):
        for spelled in _WORD.findall(part):
            words += _parted(spelled)
    kept = []
    for place, (word, spelled) in enumerate(words):
        last = place == len(words) - 1 and place > 0
        named = UNITS.get(word, "")
        if word == "in":
            if last and not stated:
                stated.append("inch")
        elif named and (last or word not in _ONLY_LAST) and named != "C" and len(words) > 1:
            stated.append(spelled if named == "?" else named)
        else:
            kept.append((word, spelled))
    units = list(dict.fromkeys(stated))
    return Name(
        column,
        tuple(word for word, _ in kept),
        units[0] if len(units) == 1 else " or ".join(units),
        tuple(spelled for _, spelled in kept),
    )


def unit_of(text: str) -> str:
    """The unit a cell such as [mm] or deg states, as the file writes it where it is not known."""
    inside = _BRACKET.search(text)
    word = (inside[1] if inside else text).strip()
    if not word.strip("-/ "):
        return ""
    named = UNITS.get(plain(word.translate(_SIGNS)), "")
    return named if named not in ("", "?") else word


def plain(word: str) -> str:
    """A word in small letters without accents."""
    apart = unicodedata.normalize("NFKD", word.translate(_SIGNS))
    return "".join(each for each in apart if not unicodedata.combining(each)).lower()


def _says_more(inside: str) -> bool:
    """Whether what stands in brackets is an index, an axis or a word such as Actual, no unit."""
    words = [plain(word) for word in _WORD.findall(inside)]
    known = [w.isdigit() or w in WORDS or _AXIS.fullmatch(w) for w in words]
    return not inside or (bool(words) and all(known) and plain(inside) not in UNITS)


def _parted(spelled: str) -> list[tuple[str, str]]:
    """A word, parted where an axis is written together with what it is: dX, Xsoll, rxdeg."""
    word = plain(spelled)
    if word in WORDS or word in UNITS:
        return [(word, spelled)]
    if (joined := _JOINED.fullmatch(word)) and _AXIS.fullmatch(joined[1]):
        return [(joined[1], spelled[: len(joined[1])]), (joined[2], joined[2])]
    for cut in range(3, len(word) - 2):
        parts = (word[:cut], word[cut:])
        if any(a in WORDS and b in _BESIDE for a, b in (parts, parts[::-1])):
            return [(parts[0], spelled[:cut]), (parts[1], spelled[cut:])]
    for size in (2, 1):
        head, tail = word[:size], word[-size:]
        if _AXIS.fullmatch(tail) and (told := _told(word[:-size])):
            return [(told, spelled[:-size]), (tail, spelled[-size:])]
        if _AXIS.fullmatch(head) and word[size:] in WORDS and len(word) > size + 1:
            return [(head, spelled[:size]), (word[size:], spelled[size:])]
    return [(word, spelled)]


def _told(stem: str) -> str:
    """What stands in front of an axis says: a word that is known, or a letter, the d of dx."""
    return stem if stem in WORDS or stem in _WORDS_OF_PLACE else LETTERS.get(stem, "")
