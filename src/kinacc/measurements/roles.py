"""Which word of a column's name says what its numbers are: measured, wanted, a difference ..

The words are those that instruments, controllers and people write, in small letters without
accents, in English, German, French, Spanish, Italian and Portuguese.
"""

from __future__ import annotations

from collections.abc import Collection

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
azimuth elevation intensity quality quaternionnorm station instrument frame uframe utool offset
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
target targets ref reference referenz referencia riferimento t estimated est estimate geschaetzt
estime filtered raw gt truth groundtruth corrected korrigiert corrige before after vor nach
initial start end base world set
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


def role(words: Collection[str]) -> str:
    """What the words say the numbers are; ``PLAIN`` where none of them speaks."""
    said = {_ROLE[word] for word in words if word in _ROLE}
    said |= {_LETTERS_ALONE[word] for word in words if word in _LETTERS_ALONE}
    for each in _RULING:
        if each in said:
            return each
    if MEASURED in said:
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
