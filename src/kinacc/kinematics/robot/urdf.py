"""Robots from URDF files: one chain between two links, converted to DH, base and flange exactly."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose, compose
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
    chain, name, (base_link, tip_link) = _between_links(path, base_link, tip_link)
    place = str(path)
    moving = [joint for joint in chain if joint.kind in MOVING]
    problems = list(_faults(moving, base_link, tip_link, place))
    refuse(problems, f"{place} cannot be used as a robot")
    axes, flange = _axes(chain)
    prismatic = np.array([joint.kind == "prismatic" for joint in moving])
    base, dh, rest = chain_of(axes, flange, prismatic)
    limits = np.array([_limits(joint) for joint in moving])
    return Robot(
        name=name,
        dh=dh,
        q_min_rad=limits[:, 0],
        q_max_rad=limits[:, 1],
        joint_map=np.eye(len(moving)),
        source=f"URDF file {path.name}, from link {base_link} to link {tip_link}",
        base=base,
        flange=rest,
        joint_names=tuple(joint.name for joint in moving),
    )


def joints_between(
    path: str | Path, base_link: str | None = None, tip_link: str | None = None
) -> list[Joint]:
    """Joints of the chain ``load`` takes, from base to tip, fixed ones included."""
    return _between_links(Path(path), base_link, tip_link)[0]


def _between_links(
    path: Path, base_link: str | None, tip_link: str | None
) -> tuple[list[Joint], str, tuple[str, str]]:
    """The chain, the name of the robot and the links the chain runs between."""
    joints, links, name = _parse(path)
    ends = _ends(joints, links, base_link, tip_link, str(path))
    return _chain(joints, *ends, str(path)), name, ends


def _axes(chain: list[Joint]) -> tuple[Axes, Pose]:
    """Axes of the moving joints and the tip, all at zero joints in the base link's frame."""
    here = Pose(np.eye(3), np.zeros(3))
    points, directions = [], []
    for joint in chain:
        here = compose(here, joint.origin)
        if joint.kind in MOVING:
            points.append(here.position_mm)
            directions.append(here.rotation @ (joint.axis / np.linalg.norm(joint.axis)))
    return Axes(np.array(points), np.array(directions)), here


def _limits(joint: Joint) -> tuple[float, float]:
    if joint.kind == "continuous":
        return -_TURN_RAD, _TURN_RAD
    low, high = joint.limits
    scale = _MM_PER_M if joint.kind == "prismatic" else 1.0
    return low * scale, high * scale


# --- which chain ----------------------------------------------------------------------------------


def _ends(
    joints: list[Joint], links: list[str], base: str | None, tip: str | None, place: str
) -> tuple[str, str]:
    children = {joint.child for joint in joints}
    problems = [
        Problem(f"{place}, {key}", f"there is no link {link!r}", ", ".join(links))
        for key, link in (("base_link", base), ("tip_link", tip))
        if link is not None and link not in links
    ]
    roots = [link for link in links if link not in children]
    if base is None and len(roots) != 1:
        what = f"has {len(roots)} links without a parent" if roots else "has no root link"
        problems.append(Problem(place, what, "one root, or base_link", ", ".join(roots or links)))
    refuse(problems, f"{place} cannot be used as a robot")
    base = base or roots[0]
    if tip is not None:
        return base, tip
    parents = {joint.parent for joint in joints}
    tips = [link for link in links if link not in parents and _reaches(joints, base, link)]
    counts = {link: _moving_between(joints, base, link) for link in tips}
    usable = [link for link in tips if FEWEST_JOINTS <= counts[link] <= MOST_JOINTS]
    if len(usable) == 1:
        return base, usable[0]
    found = "; ".join(f"{link} ({counts[link]} moving joints)" for link in tips)
    problem = Problem(
        place,
        f"the chain from {base} can end at {len(tips)} links: {found}",
        f"the link the flange is, with {FEWEST_JOINTS} to {MOST_JOINTS} moving joints before it",
        f"write a robot YAML with urdf: {Path(place).name}, base_link and tip_link; "
        f"all links: {', '.join(links)}",
    )
    raise InputError(problem, f"{place} leaves open where the arm ends")


def _up(joints: list[Joint], link: str) -> Iterator[Joint]:
    """Joints from a link towards the root."""
    by_child = {joint.child: joint for joint in joints}
    seen = set()
    while link in by_child and link not in seen:
        seen.add(link)
        yield by_child[link]
        link = by_child[link].parent


def _reaches(joints: list[Joint], base: str, link: str) -> bool:
    return link == base or any(joint.parent == base for joint in _up(joints, link))


def _between(joints: list[Joint], base: str, link: str) -> list[Joint]:
    found = []
    for joint in _up(joints, link):
        found.append(joint)
        if joint.parent == base:
            break
    return found[::-1]


def _moving_between(joints: list[Joint], base: str, link: str) -> int:
    if link == base:
        return 0
    return sum(joint.kind in MOVING for joint in _between(joints, base, link))


def _chain(joints: list[Joint], base: str, tip: str, place: str) -> list[Joint]:
    if base == tip or not _reaches(joints, base, tip):
        names = [tip, *(joint.parent for joint in _up(joints, tip))]
        problem = Problem(
            f"{place}, tip_link", f"link {tip} does not hang on {base}", "a link below base_link"
        )
        fix = f"links above {tip}: {', '.join(names[1:]) or 'none'}"
        raise InputError(Problem(problem.where, problem.what, problem.allowed, fix))
    return _between(joints, base, tip)


def _faults(moving: list[Joint], base: str, tip: str, place: str) -> Iterator[Problem]:
    if not FEWEST_JOINTS <= len(moving) <= MOST_JOINTS:
        what = f"the chain from {base} to {tip} has {len(moving)} moving joints"
        yield Problem(place, what, f"{FEWEST_JOINTS} to {MOST_JOINTS}")
    for joint in moving:
        where = f"{place}:{joint.line}, joint {joint.name}"
        if joint.mimics:
            what = f"follows joint {joint.mimics} (mimic)"
            allowed = "independent joints: the chain of a linkage is not a serial arm"
            yield Problem(where, what, allowed, "choose a tip_link before it")
        if np.linalg.norm(joint.axis) < 1e-9:
            yield Problem(where, "its axis has no direction", 'e.g. <axis xyz="0 0 1"/>')
        low, high = joint.limits
        if joint.kind != "continuous" and not (math.isfinite(low) and math.isfinite(high)):
            yield Problem(where, "has no limits", '<limit lower=".." upper=".."/>')
        elif joint.kind != "continuous" and not low < high:
            yield Problem(where, f"limits {low:g} to {high:g}", "lower below upper")


# --- the file -------------------------------------------------------------------------------------


def _parse(path: Path) -> tuple[list[Joint], list[str], str]:
    """Joints, link names and the name of the robot."""
    from lxml import etree
    from pytransform3d import urdf as library

    place, title = str(path), f"{path} cannot be used as a robot"
    root = _root(path, title)
    problems = list(_faults_of_text(root, place))
    refuse(problems, title)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on meshes it cannot find, which we do not need
            text = etree.tostring(_joints_alone(root), encoding="unicode")
            name, links, joints = library.parse_urdf(text)
    except (library.UrdfException, ValueError) as error:
        raise InputError(Problem(place, str(error).rstrip(".")), title) from None
    elements = {element.get("name"): element for element in root.findall("joint")}
    records = []
    for joint in joints:
        element = elements[joint.joint_name]
        follows = element.find("mimic")
        frame = np.asarray(joint.child2parent)
        records.append(
            Joint(
                joint.joint_name,
                joint.joint_type,
                joint.parent,
                joint.child,
                Pose(frame[:3, :3], frame[:3, 3] * _MM_PER_M),
                np.asarray(joint.joint_axis, dtype=float),
                joint.limits,
                "" if follows is None else follows.get("joint", "?"),
                element.sourceline or 0,
            )
        )
    return records, [link.name for link in links], name


def _root(path: Path, title: str):
    """The root of an XML file that is no larger than robots are and defines no entities."""
    from lxml import etree

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
        what = "defines entities, which can stand for anything"
        raise InputError(Problem(place, what, "plain URDF", "write out what they stand for"), title)
    return root


def _joints_alone(root):
    """The robot without what a chain does not need: shapes, masses, materials, plugins."""
    from lxml import etree

    alone = etree.Element("robot", dict(root.attrib))
    for link in root.findall("link"):
        etree.SubElement(alone, "link", dict(link.attrib))
    for joint in root.findall("joint"):
        kept = etree.SubElement(alone, "joint", dict(joint.attrib))
        for tag in ("origin", "parent", "child", "axis", "limit"):
            if (child := joint.find(tag)) is not None:
                etree.SubElement(kept, tag, dict(child.attrib))
    return alone


def _faults_of_text(root, place: str) -> Iterator[Problem]:
    """What a lenient parser would read as something else: macros, wrong numbers, double names."""
    if root.tag != "robot":
        yield Problem(f"{place}:{root.sourceline}", f"begins with <{root.tag}>", "<robot>")
    macros = [element for element in root.iter("{*}*") if "xacro" in str(element.tag)]
    if macros:
        where = f"{place}:{macros[0].sourceline}"
        yield Problem(where, "holds xacro macros", "plain URDF", "expand it with xacro first")
        return
    names = [element.get("name") for element in root.findall("joint")]
    if len(names) > _MOST_JOINTS:
        yield Problem(place, f"has {len(names)} joints", f"at most {_MOST_JOINTS}, fixed included")
        return
    children = [each.get("link") for each in root.findall("joint/child")]
    for what, given in (("joint", names), ("child link", children)):
        for name in sorted(str(name) for name, count in Counter(given).items() if count > 1):
            yield Problem(place, f"{what} {name} is given more than once", "every name once")
    for element in root.findall("joint"):
        where = f"{place}:{element.sourceline}, joint {element.get('name')}"
        if element.get("type") not in (*MOVING, "fixed", "planar", "floating"):
            kinds = ", ".join((*MOVING, "fixed"))
            yield Problem(where, f"its type is {element.get('type')!r}", kinds)
        if element.get("type") in ("planar", "floating"):
            yield Problem(where, f"is {element.get('type')}", ", ".join((*MOVING, "fixed")))
        for tag, key, count, most in (
            ("origin", "xyz", 3, _FARTHEST),
            ("origin", "rpy", 3, _FARTHEST),
            ("axis", "xyz", 3, _FARTHEST),
            ("limit", "lower", 1, _NO_LIMIT),
            ("limit", "upper", 1, _NO_LIMIT),
        ):
            child = element.find(tag)
            value = None if child is None else child.get(key)
            if value is not None and not _are_numbers(value, count, most):
                allowed = f"{count} finite number{'s' if count > 1 else ''} of at most {most:g}"
                said = repr(value if len(value) <= 60 else f"{value[:57]}...")
                yield Problem(where, f"{tag} {key}={said}", allowed)


def _are_numbers(text: str, count: int, most: float) -> bool:
    if not text.isascii() or "_" in text:  # Python takes more for a number than others do
        return False
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return False
    return len(values) == count and all(abs(value) <= most for value in values)
