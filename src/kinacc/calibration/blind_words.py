"""Which parameters poses do not determine, in sentences for a person who knows the arm."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from kinacc.calibration.blind_groups import LEAST, LeftOpen, of_arm
from kinacc.calibration.frames import BASE, MOTIONS, Frames
from kinacc.calibration.identified import FIXED, PRIOR, UNDETERMINED, Parameter
from kinacc.calibration.uncertainty import is_angle
from kinacc.geometry import skew

WEAK = "(these poses show it too little, others may)"
_MOST_NAMES = 4
_MOST_SAID = 3  # sentences about one parameter
_JOIN, _MORE = "; ", "and "  # of sentences about one parameter, none of which holds a semicolon
_SAME = 0.02  # relative difference of parts that count as equal
_CALLED = {
    "theta_offset_rad": "theta",
    "d_mm": "d",
    "a_mm": "a",
    "alpha_rad": "alpha",
    "beta_rad": "beta",
}


def sentences(open_: LeftOpen) -> dict[str, np.ndarray]:
    """What poses leave open, each sentence with the mask (P,) of whom it speaks."""
    found: dict[str, np.ndarray] = {}
    for group in open_.groups:
        words = sentence(group.directions, open_.names, open_.frames)
        if words in found:
            continue  # parts too small for words told them apart
        text = words if group.structural else f"{words} {WEAK}"
        found[text] = found.get(text, False) | group.members
    # Joint by joint, what concerns frames alone at the end.
    arm = of_arm(open_.names)
    first = {text: [*np.flatnonzero(each[arm]), len(arm)][0] for text, each in found.items()}
    return {text: found[text] for text in sorted(found, key=first.__getitem__)}


def reasons(parameters: Iterable[Parameter], open_: LeftOpen) -> list[str | None]:
    """Why each parameter is not identified, as ``dh_identified`` has it; None where it is."""
    said, place = sentences(open_), {name: i for i, name in enumerate(open_.names)}
    found: list[str | None] = []
    for each in parameters:
        if each.status == UNDETERMINED:
            texts = [text for text, members in said.items() if members[place[each.name]]]
            more = [f"{_MORE}{len(texts) - _MOST_SAID} more"] if len(texts) > _MOST_SAID else []
            found.append(_JOIN.join(texts[:_MOST_SAID] + more) or None)
        elif each.status == PRIOR:
            unit, factor = ("mrad", 1e3) if is_angle(each.name) else ("mm", 1.0)
            found.append(f"known beforehand to {factor * each.prior_std:g} {unit}")
        elif each.status == FIXED:
            found.append("fixed by calibration.frames" if each.name in place else "not fitted")
        else:
            found.append(None)
    return found


def listed(table: Mapping[str, Sequence]) -> list[str]:
    """Every sentence of a ``dh_identified`` table on what is left open, once, to be shown as is."""
    told = zip(table["status"], table["statement"], strict=True)
    cells = (str(cell) for status, cell in told if status == UNDETERMINED and cell)
    texts = dict.fromkeys(text for cell in cells for text in cell.split(_JOIN))
    return [text for text in texts if not text.startswith(_MORE)]


def weak(sentences: Iterable[str]) -> list[str]:
    """Those of ``listed`` that other poses than the measured ones would show, without saying so."""
    return [text.removesuffix(WEAK).rstrip() for text in sentences if text.endswith(WEAK)]


def sentence(directions: np.ndarray, names: Sequence[str], frames: Frames) -> str:
    """What it means that no pose shows the m ``directions`` (m, P; mm, mrad) of parameters.

    ``frames``: base and targets of the fit. Several directions are of the arm alone.
    """
    said = (np.abs(directions) >= LEAST).any(axis=0)
    involved = np.flatnonzero(of_arm(names) & said).tolist()
    involved.sort(key=lambda i: -np.abs(directions[:, i]).max())
    called = [parameter_name(names[i]) for i in sorted(involved)]
    moved = _motions(directions[0], names, frames) if len(directions) == 1 else []
    if not involved:
        if len(moved) > 1:
            return f"{moved[0]} cannot be told from {' and '.join(moved[1:])}"
        return f"{' and '.join(moved)} changes no measured pose"
    listed = _listed(called)
    if len(called) > _MOST_NAMES:
        most = _listed([parameter_name(names[i]) for i in involved[:_MOST_NAMES]])
        listed = f"a mixture of {len(called)} parameters, most of all {most},"
    if moved:
        together = " together" if 1 < len(called) <= _MOST_NAMES else ""
        return f"{listed}{together} cannot be told from {' and '.join(moved)}"
    if len(called) == 1:
        return f"{listed} changes no measured pose"
    if len(called) > _MOST_NAMES and len(directions) < len(called) - 1:
        return f"{listed} changes no measured pose"
    return _combination(directions[:, sorted(involved)], [names[i] for i in sorted(involved)])


def _combination(directions: np.ndarray, names: list[str]) -> str:
    """The combinations of some parameters of the arm that poses do show."""
    called = [parameter_name(name) for name in names]
    shown = np.linalg.svd(directions)[2][len(directions) :]
    if len(shown) > 1:
        amounts = ", ".join(
            f"{called[i]} {value:+.2g} {'mrad' if is_angle(names[i]) else 'mm'}"
            for i, value in enumerate(directions[0])
            if abs(value) >= LEAST
        )
        return f"{_listed(called)} appear only in combination: {amounts} changes no measured pose"
    weight = shown[0] / shown[0][0]
    if np.ptp(np.abs(weight)) < _SAME:
        if len(names) == 2:
            how = "sum" if weight[1] > 0.0 else "difference"
            return f"{_listed(called)} appear only as their {how}"
        if (weight > 0.0).all():
            return f"{_listed(called)} appear only as their sum"
        signed = "".join(
            f"{' + ' if w > 0.0 else ' - '}{each}" for w, each in zip(weight, called, strict=True)
        )
        return f"{_listed(called)} appear only as {signed.removeprefix(' + ')}"
    signed = " ".join(f"{w:+.3g} ({each})" for w, each in zip(weight, called, strict=True))
    return f"{_listed(called)} appear only as {signed} (mm and mrad)"


def _motions(direction: np.ndarray, names: Sequence[str], frames: Frames) -> list[str]:
    """The motions of base and targets that go with a direction."""
    parts: dict[str, np.ndarray] = {}
    for name, value in zip(names, direction, strict=True):
        frame, _, motion = name.partition(".")
        if motion in MOTIONS:
            parts.setdefault(frame, np.zeros(6))[MOTIONS.index(motion)] = value
    bases = {name: each for name, each in parts.items() if _number(name) is not None}
    targets = {name: each for name, each in parts.items() if _number(name) is None}
    found = []
    if bases:
        twists = [_in_robot(each, frames, _number(name)) for name, each in bases.items()]
        found += _alike(twists, list(bases), "base", "the axis of joint 1", "the robot's base")
    if targets:
        common = _common_twist(list(targets.values()), frames.targets.position_mm)
        twists = list(targets.values()) if common is None else [common]
        listed = ["tool" if len(targets) == 1 else "targets"] if common is not None else targets
        found += _alike(twists, list(listed), "targets", "z of the last frame", "the last frame")
    return found


def _alike(
    twists: list[np.ndarray], names: list[str], together: str, axis: str, frame: str
) -> list[str]:
    """Motions in words: one for all frames that move alike, else one for each."""
    if len(twists) > 1 and np.ptp(twists, axis=0).max() < LEAST:
        twists, names = twists[:1], [f"every {together.rstrip('s')}"]
    said = [_motion(each, name, axis, frame) for each, name in zip(twists, names, strict=True)]
    return [text for text in said if text]


def _motion(twist: np.ndarray, name: str, axis: str, frame: str) -> str:
    """Shift (mm) and turn (mrad) of a frame in words; empty where there is none."""
    moved = np.abs(twist) >= LEAST
    who = name if name.startswith("every") else f"the {name}"
    if not moved.any():
        return ""
    if not moved[[0, 1, 3, 4]].any():
        kinds = [word for word, at in ((f"a shift of {who} along", 2), ("a turn", 5)) if moved[at]]
        if moved[2] and moved[5]:
            return f"a screw of {who} along {axis}"
        return f"{kinds[0]} {axis}" if moved[2] else f"a turn of {who} about {axis}"
    shift, turn = (
        ", ".join(each for i, each in enumerate("xyz") if moved[offset + i]) for offset in (0, 3)
    )
    if shift and turn:
        return f"a motion of {who} (shift along {shift}, turn about {turn} of {frame})"
    kind = f"shift of {who} along {shift}" if shift else f"turn of {who} about {turn}"
    return f"a {kind} of {frame}"


def _number(frame: str) -> int | None:
    """Session of a base's name, from 0; None for a target."""
    ending = frame.removeprefix(BASE)
    if not frame.startswith(BASE) or (ending and not ending.isdigit()):
        return None
    return int(ending or 1) - 1


def _in_robot(motion: np.ndarray, frames: Frames, session: int) -> np.ndarray:
    """Motion of a base, given in the instrument's frame, in the base's own axes."""
    turn = frames.bases.rotation[session].T
    return np.concatenate([turn @ motion[:3], turn @ motion[3:]])


def _common_twist(motions: list[np.ndarray], position_mm: np.ndarray) -> np.ndarray | None:
    """Shift and turn of the last frame that moves every target so; None where none does."""
    turned = any(np.any(each[3:]) for each in motions)
    if len(motions) == 1 and not turned:
        return motions[0]
    design, goal = [], []
    for motion, at in zip(motions, position_mm, strict=True):
        design.append(np.concatenate([np.eye(3), -1e-3 * skew(at)], axis=1))  # mm per mrad
        goal.append(motion[:3])
        if turned:
            design.append(np.eye(6)[3:])
            goal.append(motion[3:])
    twist = np.linalg.lstsq(np.concatenate(design), np.concatenate(goal), rcond=1e-6)[0]
    left = np.concatenate(goal) - np.concatenate(design) @ twist
    return twist if np.abs(left).max() < LEAST else None


def parameter_name(name: str) -> str:
    """A parameter as sentences call it; of base and targets as ``calibration.frames`` writes it."""
    where, _, parameter = name.rpartition(".")
    if parameter in _CALLED:
        return f"{_CALLED[parameter]} of joint {where[1:]}"
    return f"{where} {parameter.partition('_')[0]}"


def short_name(name: str) -> str:
    """``parameter_name`` where there is little room: j2 theta."""
    where, _, parameter = name.rpartition(".")
    return f"{where} {_CALLED.get(parameter, parameter.partition('_')[0])}"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
