"""Robots from URDF files: one chain between two links, converted to DH, base and flange exactly."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree
from scipy.spatial.transform import Rotation

from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import IDENTITY, Pose, compose
from kinacc.kinematics.robot.axes import Axes, chain_of
from kinacc.kinematics.robot.record import FEWEST_JOINTS, MOST_JOINTS, Robot

MOVING = ("revolute", "continuous", "prismatic")

_TURN_RAD = 2.0 * math.pi  # the range given to a joint that turns without end, either way
_MM_PER_M = 1e3
_MOST_BYTES, _MOST_JOINTS = 10_000_000, 2000
_FARTHEST = 1e6  # of lengths in m and angles in rad: beyond, nothing about an arm is meant
_NO_LIMIT = 1e20  # some write limits of 1e16 where they mean none


@dataclass(frozen=True)
class Joint:
    """One joint of the file: its frame in the parent link (mm), axis in that frame, limits."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Pose
    axis: np.ndarray
    limits: tuple[float, float]
    mimics: str
    line: int


def load(path: str | Path, base_link: str | None = None, tip_link: str | None = None) -> Robot:
    """The arm between two links of a URDF file.

    Without ``base_link`` the chain starts at the root; without ``tip_link`` it ends at the only
    link it can end at. Raises InputError listing every fault, and the links to choose from where
    the file leaves a choice. Limits come from the file; a continuous joint gets a turn either way.
    """
    path = Path(path)
    joints, links, name = _parse(path)
    base, tip = _ends(joints, links, base_link, tip_link, str(path))
    chain = _between(joints, base, tip)
    moving = [joint for joint in chain if joint.kind in MOVING]
    refuse(list(_faults(moving, base, tip, str(path))), f"{path} cannot be used as a robot")
    here, points, directions, limits = IDENTITY, [], [], []
    for joint in chain:
        here = compose(here, joint.origin)
        if joint.kind in MOVING:
            points.append(here.position_mm)
            directions.append(here.rotation @ (joint.axis / np.linalg.norm(joint.axis)))
            scale = _MM_PER_M if joint.kind == "prismatic" else 1.0
            endless = joint.kind == "continuous"
            limits.append((-_TURN_RAD, _TURN_RAD) if endless else np.multiply(joint.limits, scale))
    prismatic = np.array([joint.kind == "prismatic" for joint in moving])
    first, dh, rest = chain_of(Axes(np.array(points), np.array(directions)), here, prismatic)
    low, high = np.array(limits, dtype=float).T
    return Robot(
        name=name,
        dh=dh,
        q_min_rad=low,
        q_max_rad=high,
        joint_map=np.eye(len(moving)),
        source=f"URDF file {path.name}, from link {base} to link {tip}",
        base=first,
        flange=rest,
        joint_names=tuple(joint.name for joint in moving),
    )


def joints_between(
    path: str | Path, base_link: str | None = None, tip_link: str | None = None
) -> list[Joint]:
    """Joints of the chain ``load`` takes, from base to tip, fixed ones included."""
    joints, links, _ = _parse(Path(path))
    return _between(joints, *_ends(joints, links, base_link, tip_link, str(path)))


def _ends(
    joints: list[Joint], links: list[str], base: str | None, tip: str | None, place: str
) -> tuple[str, str]:
    """The links the chain runs between, stated or the only ones there can be."""
    problems = [
        Problem(f"{place}, {key}", f"there is no link {link!r}", ", ".join(links))
        for key, link in (("base_link", base), ("tip_link", tip))
        if link is not None and link not in links
    ]
    children = {joint.child for joint in joints}
    roots = [link for link in links if link not in children]
    if base is None and len(roots) != 1:
        what = f"has {len(roots)} links without a parent"
        problems.append(Problem(place, what, "one root, or base_link", ", ".join(roots or links)))
    title = f"{place} cannot be used as a robot"
    refuse(problems, title)
    base = base or roots[0]
    if tip is not None:
        if tip == base or not _between(joints, base, tip):
            what = f"link {tip} does not hang on {base}"
            raise InputError(Problem(f"{place}, tip_link", what, "a link below base_link"), title)
        return base, tip
    parents = {joint.parent for joint in joints}
    chains = {link: _between(joints, base, link) for link in links if link not in parents}
    counts = {
        link: sum(joint.kind in MOVING for joint in chain)
        for link, chain in chains.items()
        if chain
    }
    usable = [link for link, count in counts.items() if FEWEST_JOINTS <= count <= MOST_JOINTS]
    if len(usable) != 1:
        found = "; ".join(f"{link} ({count} moving joints)" for link, count in counts.items())
        what = f"the chain from {base} can end at {len(counts)} links: {found}"
        allowed = f"one with {FEWEST_JOINTS} to {MOST_JOINTS} moving joints before it"
        fix = f"write a robot YAML with urdf: {Path(place).name}, base_link and tip_link"
        raise InputError(Problem(place, what, allowed, fix), title)
    return base, usable[0]


def _between(joints: list[Joint], base: str, link: str) -> list[Joint]:
    """Joints from a link above to a link; none where the one does not hang on the other."""
    above = {joint.child: joint for joint in joints}
    chain: list[Joint] = []
    while link != base and link in above and len(chain) < len(joints):
        chain.append(above[link])
        link = above[link].parent
    return chain[::-1] if link == base else []


def _faults(moving: list[Joint], base: str, tip: str, place: str) -> Iterator[Problem]:
    if not FEWEST_JOINTS <= len(moving) <= MOST_JOINTS:
        what = f"the chain from {base} to {tip} has {len(moving)} moving joints"
        yield Problem(place, what, f"{FEWEST_JOINTS} to {MOST_JOINTS}")
    for joint in moving:
        where = f"{place}:{joint.line}, joint {joint.name}"
        if joint.mimics:
            what = f"follows joint {joint.mimics} (mimic)"
            yield Problem(where, what, "independent joints", "choose a tip_link before it")
        if np.linalg.norm(joint.axis) < 1e-9:
            yield Problem(where, "its axis has no direction", 'e.g. <axis xyz="0 0 1"/>')
        low, high = joint.limits
        if joint.kind != "continuous" and not low < high:
            yield Problem(where, f"limits {low:g} to {high:g}", '<limit lower=".." upper=".."/>')


def _parse(path: Path) -> tuple[list[Joint], list[str], str]:
    """Joints, link names and the name of the robot."""
    place, title = str(path), f"{path} cannot be used as a robot"
    root = _root(path, title)
    if root.tag != "robot" or not root.get("name"):
        raise InputError(Problem(place, "is no <robot name=..>", "a URDF file"), title)
    if any("xacro" in str(element.tag) for element in root.iter("{*}*")):
        what = "holds xacro macros"
        raise InputError(Problem(place, what, "plain URDF", "expand it with xacro first"), title)
    elements, links = root.findall("joint"), [each.get("name", "") for each in root.findall("link")]
    if len(elements) > _MOST_JOINTS:
        what = f"has {len(elements)} joints"
        raise InputError(Problem(place, what, f"at most {_MOST_JOINTS}, fixed included"), title)
    problems: list[Problem] = []
    joints = [_joint(element, place, links, problems) for element in elements]
    for what, given in (("joint", "name"), ("child link", "child")):
        counts = Counter(getattr(joint, given) for joint in joints)
        for name in (name for name, count in counts.items() if count > 1):
            problems.append(Problem(place, f"{what} {name} is given more than once"))
    refuse(problems, title)
    return joints, links, root.get("name")


def _root(path: Path, title: str):
    """The root of an XML file that is no larger than robots are and defines no entities."""
    place = str(path)
    try:
        with open(path, "rb") as stream:
            text = stream.read(_MOST_BYTES + 1)
    except OSError as error:
        raise InputError(Problem(place, (error.strerror or "").lower(), "a URDF file")) from None
    if len(text) > _MOST_BYTES:
        allowed = f"at most {_MOST_BYTES // 1_000_000} MB"
        raise InputError(Problem(place, "is too large for a robot", allowed), title)
    parser = etree.XMLParser(
        remove_comments=True, remove_pis=True, resolve_entities=False, no_network=True
    )
    try:
        root = etree.fromstring(text, parser)
    except etree.XMLSyntaxError as error:
        line = getattr(error, "lineno", None) or 1
        raise InputError(Problem(f"{place}:{line}", f"is not XML: {error.msg}"), title) from None
    definitions = root.getroottree().docinfo.internalDTD
    if definitions is not None and any(True for _ in definitions.iterentities()):
        raise InputError(Problem(place, "defines entities", "plain URDF"), title)
    return root


def _joint(element, place: str, links: list[str], problems: list[Problem]) -> Joint:
    """A joint of the file; what is wrong with it goes to ``problems``."""
    name, kind = str(element.get("name")), element.get("type")
    where = f"{place}:{element.sourceline}, joint {name}"
    if kind not in (*MOVING, "fixed"):
        problems.append(Problem(where, f"its type is {kind!r}", ", ".join((*MOVING, "fixed"))))

    def value(tag: str, key: str) -> str | None:
        child = element.find(tag)
        return None if child is None else child.get(key)

    def numbers(tag: str, key: str, default: str, most: float = _FARTHEST) -> list[float]:
        text, count = value(tag, key) or default, len(default.split())
        try:
            found = [float(word) for word in text.split()]
        except ValueError:
            found = []
        odd = not text.isascii() or "_" in text  # Python takes more for a number than others do
        if len(found) != count or odd or not all(abs(each) <= most for each in found):
            allowed = f"{count} finite number{'s' if count > 1 else ''} of at most {most:g}"
            problems.append(Problem(where, f"{tag} {key}={text[:60]!r}", allowed))
            return [0.0] * count
        return found

    parent, child = str(value("parent", "link")), str(value("child", "link"))
    for link in (parent, child):
        if link not in links:
            problems.append(Problem(where, f"there is no link {link!r}"))
    turn = Rotation.from_euler("xyz", numbers("origin", "rpy", "0 0 0")).as_matrix()
    origin = Pose(turn, _MM_PER_M * np.array(numbers("origin", "xyz", "0 0 0")))
    axis = np.array(numbers("axis", "xyz", "1 0 0"))
    ends = (numbers("limit", key, "0", _NO_LIMIT)[0] for key in ("lower", "upper"))
    follows = "" if element.find("mimic") is None else element.find("mimic").get("joint", "?")
    return Joint(name, kind, parent, child, origin, axis, tuple(ends), follows, element.sourceline)
