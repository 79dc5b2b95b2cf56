"""Faults as they come about, planted in rows of a file."""

import numpy as np
from scipy.spatial.transform import Rotation

ANGLES = ["rx_deg", "ry_deg", "rz_deg"]


def joints(file):
    """Columns of the joints."""
    return [name for name in file.columns if name.startswith("q") and name.endswith("_deg")]


def points(file):
    """Columns of the positions."""
    return [name for name in file.columns if name.endswith("_mm") and "std" not in name]


def every(file):
    """All rows."""
    return np.arange(len(file))


def some(file, count=6, seed=1):
    """A few rows."""
    return np.sort(np.random.default_rng(seed).choice(len(file), count, replace=False))


def late(file, share=0.6):
    """The rows after a while."""
    return np.arange(int(share * len(file)), len(file))


def put(file, names, rows, values):
    """The file with other values (m, k) in rows of columns."""
    columns = file.columns.astype(dict.fromkeys(names, float))
    columns.loc[rows, names] = values
    return file.but(**columns[names])


def taken(file, names, rows):
    """Values (m, k) of rows of columns."""
    return file.columns.loc[rows, names].to_numpy(copy=True)


def scaled(file, names, factor, rows):
    """Numbers of columns times a factor."""
    return put(file, list(names), rows, taken(file, list(names), rows) * factor)


def joints_in_radians(file, rows):
    """Joints in radians under columns that say degrees."""
    return scaled(file, joints(file), np.pi / 180.0, rows)


def angles_in_radians(file, rows):
    """Orientations in radians under columns that say degrees."""
    return scaled(file, ANGLES, np.pi / 180.0, rows)


def in_metres(file, rows):
    """Positions in metres under columns that say millimetres."""
    return scaled(file, points(file), 1e-3, rows)


def reversed_joint(file, rows, joint=3):
    """A joint that counts the other way."""
    return scaled(file, [f"q{joint}_deg"], -1.0, rows)


def rotations(file):
    """Orientations as matrices."""
    angles = taken(file, ANGLES, every(file))
    if "euler" in file.orientation:
        return Rotation.from_euler("XYZ", angles, degrees=True).as_matrix()
    return Rotation.from_rotvec(angles, degrees=True).as_matrix()


def turned(file, rotation, rows):
    """The file with other orientations (n, 3, 3) in some rows."""
    turn = Rotation.from_matrix(rotation[rows])
    euler = "euler" in file.orientation
    angles = turn.as_euler("XYZ", degrees=True) if euler else turn.as_rotvec(degrees=True)
    return put(file, ANGLES, rows, angles)


def transposed(file, rows):
    """Orientations of the instrument seen from the target."""
    return turned(file, np.swapaxes(rotations(file), 1, 2), rows)


def of_another_convention(file, rows):
    """Euler angles ZYX where XYZ is stated, each angle in the column of its axis."""
    angles = Rotation.from_matrix(rotations(file)).as_euler("ZYX", degrees=True)
    return put(file, ANGLES, rows, angles[rows, ::-1])


def mirrored(file, rows, axis="y"):
    """Positions in left-handed coordinates."""
    return scaled(file, [n for n in points(file) if n.endswith(f"{axis}_mm")], -1.0, rows)


def coupled(file, rows):
    """Joint 3 counted from the horizontal: less joint 2."""
    two = ["q3_deg", "q2_deg"]
    return put(file, two[:1], rows, taken(file, two, rows) @ [[1.0], [-1.0]])


def copied(file, rows):
    """Rows that stand in the file again at its end, and where they stand then."""
    order = np.concatenate([every(file), rows])
    return file.rows(order), np.arange(len(file), len(order))


def shifted(file, names, by_mm, rows):
    """Positions moved by vectors in the instrument's frame."""
    return put(file, list(names), rows, taken(file, list(names), rows) + by_mm)


def jumped(file, rows, by_mm=(1.0, -0.5, 0.7), turn_mrad=1.0):
    """The base frame elsewhere: positions and orientations moved and turned about vertical."""
    turn, names = Rotation.from_rotvec([0.0, 0.0, 1e-3 * turn_mrad]), points(file)
    other = file
    for begin in range(0, len(names), 3):
        three = names[begin : begin + 3]
        other = put(other, three, rows, turn.apply(taken(file, three, rows)) + by_mm)
    if not set(ANGLES) <= set(file.columns):
        return other
    return turned(other, turn.as_matrix() @ rotations(file), rows)


def triad(file, names):
    """Rotations (n, 3, 3) of the flange, as three targets on it show."""
    a, b, c = (taken(file, [f"{n}_{axis}_mm" for axis in "xyz"], every(file)) for n in names)
    x = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    z = np.cross(x, c - a)
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def on_the_flange(file, flange, by_mm, rows, prefix=""):
    """A target that sits elsewhere on the flange, whose rotations (n, 3, 3) are known."""
    names = [f"{prefix}{axis}_mm" for axis in "xyz"]
    return shifted(file, names, (flange @ np.asarray(by_mm, dtype=float))[rows], rows)


def exchanged(file, rows):
    """Readings of two targets taken for one another."""
    names = [[f"{name}_{axis}_mm" for axis in "xyz"] for name in ("mA", "mB")]
    return put(file, names[0] + names[1], rows, taken(file, names[1] + names[0], rows))


def rounded(file, rows, digits=0):
    """Joints as commanded, on round numbers, where the arm was a little off them."""
    return put(file, joints(file), rows, np.round(taken(file, joints(file), rows), digits))
