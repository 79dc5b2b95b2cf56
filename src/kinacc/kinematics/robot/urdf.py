"""Robots from URDF files: one chain between two links, converted to DH, base and flange exactly."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree
from scipy.spatial.transform import Rotation

from kinacc.errors import input_error
from kinacc.geometry import IDENTITY, Pose, compose
from kinacc.kinematics.robot.axes import Axes, chain_of
from kinacc.kinematics.robot.record import FEWEST_JOINTS, MOST_JOINTS, Robot

MOVING = ("revolute", "continuous", "prismatic")

_TURN_RAD = 2.0 * np.pi  # the range given to a joint that turns without end, either way
_MM_PER_M = 1e3
_MOST_BYTES, _MOST_JOINTS = 10_000_000, 2000
_FARTHEST = 1e6  # of lengths in m and angles in rad: beyond, nothing about an arm is meant
_NO_LIMIT = 1e20  # some write limits of 1e16 where they mean none


@dataclass(frozen=True)
class Joint:
    """One joint of a URDF file.

    Attributes
    ----------
    name, kind, parent, child : str
        Name and type of the joint, names of its links.
    origin : Pose
        Frame of the joint in the parent link, mm.
    axis : numpy.ndarray
        Axis in that frame, shape (3,), as written.
    limits : tuple of float
        Ends of the joint, rad (m where it slides).
    mimics : str
        Joint it follows; empty where it is independent.
    line : int
        Line of the file.
    """

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

    Parameters
    ----------
    path : str or pathlib.Path
        The file.
    base_link : str, optional
        Link where the chain starts; the root when not given.
    tip_link : str, optional
        Link where the chain ends; when not given, the only one it can end at.

    Returns
    -------
    Robot
        The arm, converted to DH exactly. Limits come from the file; a continuous joint gets a turn
        either way.

    Raises
    ------
    InputError
        Where the file cannot be used; it names the links to choose from where there is a choice.
    """
    path = Path(path)
    name, joints = _chain(path, base_link, tip_link)
    moving = [joint for joint in joints if joint.kind in MOVING]
    here, points, directions, limits = IDENTITY, [], [], []
    for joint in joints:
        here = compose(here, joint.origin)
        if joint.kind not in MOVING:
            continue
        where, size = f"{path}:{joint.line}, joint {joint.name}", np.linalg.norm(joint.axis)
        low, high = joint.limits
        if joint.mimics:
            fault = f"follows joint {joint.mimics} (mimic)"
            raise input_error(where, fault, "independent joints")
        if size < 1e-9:
            raise input_error(where, "its axis has no direction", 'e.g. <axis xyz="0 0 1"/>')
        if not low < high:
            fault = f"limits {low:g} to {high:g}"
            raise input_error(where, fault, '<limit lower=".." upper=".."/>')
        points.append(here.position_mm)
        directions.append(here.rotation @ (joint.axis / size))
        limits.append(np.multiply(joint.limits, _MM_PER_M if joint.kind == "prismatic" else 1.0))
    prismatic = np.array([joint.kind == "prismatic" for joint in moving])
    first, dh, rest = chain_of(Axes(np.array(points), np.array(directions)), here, prismatic)
    low, high = np.array(limits).T
    return Robot(
        name=name,
        dh=dh,
        q_min_rad=low,
        q_max_rad=high,
        joint_map=np.eye(len(moving)),
        source=f"URDF file {path.name}, from link {joints[0].parent} to link {joints[-1].child}",
        base=first,
        flange=rest,
        joint_names=tuple(joint.name for joint in moving),
    )


def joints_between(
    path: str | Path, base_link: str | None = None, tip_link: str | None = None
) -> list[Joint]:
    """Joints of the chain that ``load`` takes, from base to tip, fixed ones included.

    Parameters
    ----------
    path : str or pathlib.Path
        The URDF file.
    base_link, tip_link : str, optional
        As for ``load``.

    Returns
    -------
    list of Joint
        The joints.

    Raises
    ------
    InputError
        As ``load``, for the file and its chain.
    """
    return _chain(Path(path), base_link, tip_link)[1]


def _chain(path: Path, base: str | None, tip: str | None) -> tuple[str, list[Joint]]:
    """Name of the robot, and the joints between two links: those stated, or the only choice."""
    place, root = str(path), _root(path)
    links = [link.get("name", "") for link in root.findall("link")]
    joints = [_joint(element, path, links) for element in root.findall("joint")]
    for kind, key in (("joint", "name"), ("child link", "child")):
        for name, count in Counter(getattr(joint, key) for joint in joints).items():
            if count > 1:
                raise input_error(place, f"{kind} {name} is given more than once")
    above = {joint.child: joint for joint in joints}
    roots = [link for link in links if link not in above]
    if base is None and len(roots) != 1:
        fault = f"has {len(roots)} links without a parent"
        raise input_error(place, fault, "one root, or base_link", ", ".join(roots or links))
    base = base or roots[0]
    parents = {joint.parent for joint in joints}
    leaves = [link for link in links if link not in parents]
    chains: dict[str, list[Joint]] = {}
    for end in dict.fromkeys([*leaves, tip or base]):
        chain: list[Joint] = []
        link = end
        while link != base and link in above and len(chain) < len(joints):
            chain.insert(0, above[link])
            link = above[link].parent
        if chain and link == base:
            chains[end] = chain
    moving = {end: sum(joint.kind in MOVING for joint in chains[end]) for end in chains}
    usable = [end for end in chains if FEWEST_JOINTS <= moving[end] <= MOST_JOINTS]
    if tip in usable or (tip is None and len(usable) == 1):
        return str(root.get("name")), chains[tip or usable[0]]
    ends = "; ".join(f"{link} ({count} moving joints)" for link, count in moving.items())
    fault = f"the chain from {base} can end at {len(chains)} links: {ends}"
    allowed = f"one with {FEWEST_JOINTS} to {MOST_JOINTS} moving joints before it"
    fix = f"write a robot YAML with urdf: {path.name}, base_link and tip_link"
    raise input_error(place, fault, allowed, fix)


def _root(path: Path) -> etree._Element:
    """The root of a URDF file that is no larger than robots are and defines no entities."""
    place = str(path)
    try:
        with open(path, "rb") as stream:
            text = stream.read(_MOST_BYTES + 1)
    except OSError as error:
        raise input_error(place, (error.strerror or "").lower(), "a URDF file") from None
    if len(text) > _MOST_BYTES:
        allowed = f"at most {_MOST_BYTES // 1_000_000} MB"
        raise input_error(place, "is too large for a robot", allowed)
    parser = etree.XMLParser(
        remove_comments=True, remove_pis=True, resolve_entities=False, no_network=True
    )
    try:
        root = etree.fromstring(text, parser)
    except etree.XMLSyntaxError as error:
        raise input_error(f"{place}:{error.lineno or 1}", f"is not XML: {error.msg}") from None
    if root.getroottree().docinfo.internalDTD is not None:
        fault = "has a document type, which may define entities"
        raise input_error(place, fault, "plain URDF")
    if root.tag != "robot" or not root.get("name"):
        raise input_error(place, "is no <robot name=..>", "a URDF file")
    if any("xacro" in str(element.tag) for element in root.iter("{*}*")):
        fault = "holds xacro macros"
        raise input_error(place, fault, "plain URDF", "expand it with xacro first")
    count = len(root.findall("joint"))
    if count > _MOST_JOINTS:
        allowed = f"at most {_MOST_JOINTS}, fixed included"
        raise input_error(place, f"has {count} joints", allowed)
    return root


def _joint(element: etree._Element, path: Path, links: list[str]) -> Joint:
    name, kind = str(element.get("name")), str(element.get("type"))
    where = f"{path}:{element.sourceline}, joint {name}"
    if kind not in (*MOVING, "fixed"):
        raise input_error(where, f"its type is {kind!r}", ", ".join((*MOVING, "fixed")))

    def text(tag: str, key: str, default: str) -> str:
        child = element.find(tag)
        return default if child is None else child.get(key) or default

    def numbers(tag: str, key: str, default: str, most: float = _FARTHEST) -> np.ndarray:
        value, count = text(tag, key, default), len(default.split())
        try:
            values = np.array([float(word) for word in value.split()])
        except ValueError:
            values = np.array([])
        if len(values) != count or not (np.abs(values) <= most).all():
            allowed = f"{count} finite, at most {most:g}"
            raise input_error(where, f"{tag} {key}={value[:60]!r}", allowed)
        return values

    parent, child = (text(tag, "link", "None") for tag in ("parent", "child"))
    for link in (parent, child):
        if link not in links:
            raise input_error(where, f"there is no link {link!r}")
    turn = Rotation.from_euler("xyz", numbers("origin", "rpy", "0 0 0")).as_matrix()
    origin = Pose(turn, _MM_PER_M * numbers("origin", "xyz", "0 0 0"))
    low, high = (float(numbers("limit", key, "0", _NO_LIMIT)[0]) for key in ("lower", "upper"))
    limits = (-_TURN_RAD, _TURN_RAD) if kind == "continuous" else (low, high)
    mimics = "" if element.find("mimic") is None else text("mimic", "joint", "?")
    axis = numbers("axis", "xyz", "1 0 0")
    line = int(str(element.sourceline))
    return Joint(name, kind, parent, child, origin, axis, limits, mimics, line)
