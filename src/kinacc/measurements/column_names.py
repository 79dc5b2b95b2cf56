"""What a column's name says: its words, its unit, and what its numbers are.

The words are those that instruments, controllers and people write, in small letters without
accents, in English, German, French, Spanish, Italian and Portuguese; Japanese ones are put into
English first.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection
from dataclasses import dataclass

from kinacc.measurements.japanese import in_english

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

_OTHER = """
effort efforts dot velocity vel speed geschwindigkeit vitesse velocidad velocita qd qdd dq ddq
acceleration acc accel beschleunigung aceleracion accelerazione jerk torque tau drehmoment couple
coppia par force forces kraft fuerza forza ft wrench moment moments momento current currents strom
courant corriente corrente voltage voltages spannung temperature temperatures temp temperatur
temperatura temps mode modes status state gain output outputs input inputs digital analog control
accelerometer gyro imu payload cog inertia normal direction dir vector distance dist abstand
radius radii rayon radio raggio raio halbmesser diameter durchmesser diametre diametro azimuth
elevation intensity quality quaternionnorm station instrument frame uframe utool offset
origin ursprung speedscaling load time zeit stamp timestamp date
"""
_SPREAD = """
std sigma stddev stdev sd uncertainty uncertainties unc uncert unsicherheit messunsicherheit
standardunsicherheit standardabweichung stdabw incertitude incertidumbre incertezza incerteza u95
tol tolerance toleranz tolerancia tolleranza variance varianz var cov covariance rms rmse range
min max minimum maximum streuung accuracy genauigkeit precision repeatability ci confidence
standard estandar u2 mad spread noise rauschen bruit plusminus usl lsl utol ltol type
"""
_DEVIATION = """
dev devs deviation deviations delta deltas δ diff diffs dif difference differences differenz err
error errors residual residuals residuum residuen resid res abweichung abweichungen abw fehler
ecart ecarts erreur residu desviacion desv diferencia residuo scarto scarti scostamento errore
differenza deviazione desvio erro diferenca correction corrections corr korrektur correccion
correzione shift versatz bias misclosure fehlerwert
"""
_NOMINAL = """
nenn nennwert nennmass design designed goal goals cmd cmds command commands commanded soll
sollwert sollwerte sollpos sollposition nominal nom nominell nominelle nominale nominales setpoint
setpoints desired des wanted theoretical theoretisch theo theor theorique theoriques teorico
teorica consigne consignes consigna consignas programmed programmiert programme programado
programmato prog planned plan geplant planifie ideal expected erwartet attendu esperado atteso
cible cibles objetivo obiettivo comandado comandada comandato comandata commande commandee vorgabe
vorgabewert ziel zielwert zielpos zielposition deseado deseada desiderato desiderata desejado
desejada richiesto requested demanded demand simulated sim simulation simule predicted prediction
pred predicho modelled modeled model modell cad taught teach geteacht
"""
_MEASURED = """
measured measurement measurements meas messwert messwerte messung gemessen gemessene mess mes
mesure mesures mesuree mesurees medido medida medidos medidas medicion misurato misurata misurati
misura misure medicao tracker lasertracker laser leica faro smr observed observation obs
beobachtet cmm photogrammetry vicon optitrack mocap reflector reflektor reflecteur prism prisma
tmac
"""
_REPORTED = """
actual actuals act actualvalue ist istwert istwerte istpos istposition aktuell akt real reel
reelle reels effettivo effettiva effettivi attuale reale feedback fb encoder encoders enc reported
readback
"""
_CALCULATED = """
robot robots rob roboter robota roboten controller steuerung ctrl rtde fk forward kinematics
kinematik robtarget crobt calc calculated computed berechnet calcule calculado calcolato
"""
# Soft: a measured tool centre point is written so too, and a target is also what a tracker follows.
_FRAME = """
tcp flange flansch bride brida flangia ee eef effector endeffector cartesian cart kartesisch kart
"""
_OPEN = """
target targets trans ref reference referenz referencia riferimento t estimated est estimate
geschaetzt estime filtered raw gt truth groundtruth corrected korrigiert corrige before after vor
nach initial start end base world set
"""

_ROLE = {
    word: role
    for role, words in (
        (OPEN, _OPEN + _FRAME),
        (CALCULATED, _CALCULATED),
        (REPORTED, _REPORTED),
        (NOMINAL, _NOMINAL),
        (MEASURED, _MEASURED),
        (DEVIATION, _DEVIATION),
        (SPREAD, _SPREAD),
        (OTHER, _OTHER),
    )
    for word in words.split()
}
WORDS = frozenset(_ROLE)
# Say that it was measured, and are what a measured target is called.
_NAMES = frozenset(("smr", "reflector", "reflektor", "reflecteur", "prism", "prisma", "tmac"))
_COMMANDS = frozenset((*_NOMINAL.split(), "target", "targets", "ref", "reference", "set"))
# Types of RAPID: what a value is written as, and not whether it was wanted or measured.
_TYPES = frozenset(("jointtarget", "robtarget"))
_FRAMES = frozenset(_FRAME.split())
ONE_SIGMA = frozenset(("std", "sigma", "stddev", "stdev", "sd", "stdabw", "standardabweichung"))
# Letters that say so in front of an axis: dx, ux. Alone, as in d_x, they may be a target's name.
LETTERS = (
    dict.fromkeys("dδ", "delta")
    | dict.fromkeys("us", "uncertainty")
    | dict.fromkeys("vw", "velocity")
    | dict.fromkeys("ag", "acceleration")
    | dict.fromkeys("noi", "normal")
    | {"e": "error", "σ": "sigma", "f": "force", "p": "position", "t": "t", "m": "m"}
)
_LETTERS_ALONE = {"d": DEVIATION, "δ": DEVIATION, "u": SPREAD, "σ": SPREAD}
_OPEN_ALONE = frozenset("esvtnm")

# What rules where several words speak: "position error" is no position, "std dev" no deviation.
_RULING = (OTHER, SPREAD, DEVIATION)

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
_NO_UNIT = "-/ ?\ufffd"  # no more is left of a degree sign in the wrong encoding
_AXIS = re.compile(r"(?:r|q)?[xyzw]|q|j")
_COVERAGE = re.compile(r"(?<![^\W_])k\s*=\s*([123])(?!\d|[.,]\d)", re.IGNORECASE)  # (k=2)
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
    the words as the file writes them. ``coverage``: the k of an uncertainty, 0 where none is said.
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
    unit = unit_of(_COVERAGE.sub("", unit))
    stated = [unit] if unit else []
    text = _T_MAC.sub("tmac", in_english(_COVERAGE.sub("", column)).translate(_SIGNS))

    def put_aside(bracket: re.Match[str]) -> str:
        if _says_more(bracket[1]):
            return bracket[0]
        stated.extend([unit_of(bracket[1])] if unit_of(bracket[1]) else [])
        return " "

    text = _BRACKET.sub(put_aside, text)
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
        int(covered[1]) if covered else 0,
    )


def unit_of(text: str) -> str:
    """The unit a cell such as [mm] or deg states, as the file writes it where it is not known."""
    text = in_english(text)
    inside = _BRACKET.search(text)
    word = (inside[1] if inside else text).strip()
    if not word.strip(_NO_UNIT):
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
    if not word:  # an accent alone
        return []
    if word in WORDS or word in UNITS or word in _TYPES:
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


def role(words: Collection[str]) -> str:
    """What the words say the numbers are; ``PLAIN`` where none of them speaks."""
    said = {_ROLE[word] for word in words if word in _ROLE}
    said |= {_LETTERS_ALONE[word] for word in words if word in _LETTERS_ALONE}
    for each in _RULING:
        if each in said:
            return each
    if MEASURED in said:
        said = {_ROLE[word] for word in words if word in _ROLE and word not in _TYPES}
        return OPEN if {NOMINAL, CALCULATED} & said else MEASURED
    if NOMINAL in said:
        return OPEN if REPORTED in said else NOMINAL
    if CALCULATED in said:
        return CALCULATED
    if REPORTED in said:
        # The controller's own forward kinematics: actual_TCP_pose.
        return CALCULATED if _FRAMES & set(words) else OPEN if OPEN in said else REPORTED
    if OPEN in said or _OPEN_ALONE & set(words):
        return OPEN
    return PLAIN


def speaks(word: str) -> bool:
    """Whether a word says what numbers are, and so is no part of a target's name."""
    return word in _ROLE and word not in _NAMES | _FRAMES


def commands(words: Collection[str]) -> bool:
    """Whether words of joints say that these were commanded."""
    return role(words) in (NOMINAL, OPEN) and bool(_COMMANDS & set(words))


def is_own_pose(words: Collection[str]) -> bool:
    """Whether the words are those of a pose that the controller calculates from its joints."""
    return bool(_FRAMES & set(words)) and any(_ROLE.get(word) == REPORTED for word in words)


def is_frame(words: Collection[str]) -> bool:
    """Whether the words are what the tool centre point is called, and nothing else."""
    return bool(words) and set(words) <= _FRAMES
