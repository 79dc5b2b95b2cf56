"""Faults as they come about, planted in a file; each says which rows it is in."""

import numpy as np
from good_files import File

from kinacc.geometry import exp_so3, log_so3, rotation_x, rotation_y, rotation_z

ANGLES = tuple(f"r{axis}_deg" for axis in "xyz")


def joints(file: File) -> tuple[str, ...]:
    """Columns of the joints."""
    return tuple(n for n in file.columns if n.startswith("q") and n.endswith("_deg"))


def points(file: File) -> tuple[str, ...]:
    """Columns of the positions."""
    return tuple(n for n in file.columns if n.endswith("_mm") and "std" not in n)


def every(file: File) -> np.ndarray:
    """All rows."""
    return np.arange(len(file))


def some(file: File, count: int = 6, seed: int = 1) -> np.ndarray:
    """A few rows."""
    return np.sort(np.random.default_rng(seed).choice(len(file), count, replace=False))


def late(file: File, share: float = 0.6) -> np.ndarray:
    """The rows after a while."""
    return np.arange(int(share * len(file)), len(file))


def scaled(file: File, names, factor: float, rows) -> File:
    """Numbers of columns times a factor."""
    columns = {name: file.columns[name].copy() for name in names}
    for values in columns.values():
        values[rows] *= factor
    return file.but(**columns)


def in_radians(file: File, names, rows) -> File:
    """Angles in radians under columns that say degrees."""
    return scaled(file, names, np.pi / 180.0, rows)


def rotations(file: File) -> np.ndarray:
    """Orientations as matrices."""
    angles = np.deg2rad(np.stack([file.columns[name] for name in ANGLES], axis=1))
    if "euler" in file.orientation:
        return rotation_x(angles[:, 0]) @ rotation_y(angles[:, 1]) @ rotation_z(angles[:, 2])
    return exp_so3(angles)


def turned(file: File, rotation: np.ndarray, rows) -> File:
    """The file with other orientations (n, 3, 3) in some rows."""
    if "euler" in file.orientation:
        angles = np.stack(
            [
                np.arctan2(-rotation[:, 1, 2], rotation[:, 2, 2]),
                np.arcsin(rotation[:, 0, 2]),
                np.arctan2(-rotation[:, 0, 1], rotation[:, 0, 0]),
            ],
            axis=1,
        )
    else:
        angles = log_so3(rotation)
    columns = {name: file.columns[name].copy() for name in ANGLES}
    for axis, name in enumerate(ANGLES):
        columns[name][rows] = np.rad2deg(angles[rows, axis])
    return file.but(**columns)


def transposed(file: File, rows) -> File:
    """Orientations of the instrument seen from the target."""
    return turned(file, np.swapaxes(rotations(file), 1, 2), rows)


def of_another_convention(file: File) -> File:
    """Euler angles ZYX where XYZ is stated, each angle in the column of its axis."""
    r = rotations(file)
    z = np.arctan2(r[:, 1, 0], r[:, 0, 0])
    y = -np.arcsin(r[:, 2, 0])
    x = np.arctan2(r[:, 2, 1], r[:, 2, 2])
    return file.but(**dict(zip(ANGLES, np.rad2deg([x, y, z]), strict=True)))


def mirrored(file: File, axis: str, rows) -> File:
    """Positions in left-handed coordinates."""
    names = [name for name in points(file) if name.endswith(f"{axis}_mm")]
    return scaled(file, names, -1.0, rows)


def coupled(file: File, rows) -> File:
    """Joint 3 counted from the horizontal: less joint 2."""
    values = file.columns["q3_deg"].copy()
    values[rows] -= file.columns["q2_deg"][rows]
    return file.but(q3_deg=values)


def copied(file: File, rows) -> tuple[File, np.ndarray]:
    """Rows that stand in the file again at its end, and where they stand then."""
    order = np.concatenate([every(file), rows])
    return file.rows(order), np.arange(len(file), len(order))


def shifted(file: File, names, by_mm, rows) -> File:
    """Positions moved by a vector in the instrument's frame."""
    columns = {name: file.columns[name].copy() for name in names}
    for name, value in zip(names, by_mm, strict=True):
        columns[name][rows] += value
    return file.but(**columns)


def jumped(file: File, by_mm, turn_mrad: float, rows) -> File:
    """The base frame elsewhere: positions and orientations moved and turned about vertical."""
    turn = rotation_z(np.array(1e-3 * turn_mrad))
    names = points(file)
    columns = {}
    for begin in range(0, len(names), 3):
        three = names[begin : begin + 3]
        place = np.stack([file.columns[name] for name in three], axis=1)
        place[rows] = place[rows] @ turn.T + by_mm
        columns |= dict(zip(three, place.T, strict=True))
    other = file.but(**columns)
    if not all(name in file.columns for name in ANGLES):
        return other
    return turned(other, turn @ rotations(file), rows)


def triad(file: File, names: tuple[str, str, str]) -> np.ndarray:
    """Rotations (n, 3, 3) of the flange, as three targets on it show."""
    a, b, c = (
        np.stack([file.columns[f"{name}_{axis}_mm"] for axis in "xyz"], axis=1) for name in names
    )
    x = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    z = np.cross(x, c - a)
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def on_the_flange(file: File, flange: np.ndarray, by_mm, rows, prefix: str = "") -> File:
    """A target that sits elsewhere on the flange, whose rotations (n, 3, 3) are known."""
    names = [f"{prefix}{axis}_mm" for axis in "xyz"]
    moved = flange @ np.asarray(by_mm, dtype=float)
    columns = {name: file.columns[name].copy() for name in names}
    for axis, name in enumerate(names):
        columns[name][rows] += moved[rows, axis]
    return file.but(**columns)


def exchanged(file: File, one: str, other: str, rows) -> File:
    """Readings of two targets taken for one another."""
    columns = {}
    for axis in "xyz":
        names = f"{one}_{axis}_mm", f"{other}_{axis}_mm"
        values = [file.columns[name].copy() for name in names]
        values[0][rows], values[1][rows] = values[1][rows], values[0][rows].copy()
        columns |= dict(zip(names, values, strict=True))
    return file.but(**columns)


def rounded(file: File, rows, digits: int = 1) -> File:
    """Joints as commanded, on round numbers, where the arm was a little off them."""
    columns = {name: file.columns[name].copy() for name in joints(file)}
    for values in columns.values():
        values[rows] = np.round(values[rows], digits)
    return file.but(**columns)
