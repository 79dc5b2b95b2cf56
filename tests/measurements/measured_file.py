"""What is true of a measured file, and the pieces from which such files are written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from measurements.simulated_arms import KR10_YAML
from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class Measured:
    """A measured file, or two, and what a reader has to find: one row per reading.

    `joints_rad` (n, k) as the robot reports them; `points_mm` per target (n, 3), nan without a
    reading; `rotations` (n, 3, 3) of the first target or None; `std_mm` per target (n, 3) where
    stated. `questions`: what the file leaves open. `must_ask`: the same, where neither the file
    nor the numbers can answer. `any_frame`: the reader chooses the axes (angles and distance).
    `says`: what the answer has to mention, as a regular expression. Where `readable` is False the
    file may be refused: it lacks something, or nobody would blame a reader for saying no.
    """

    files: tuple[Path, ...]
    robot: str
    joints_rad: np.ndarray
    points_mm: dict[str, np.ndarray]
    rotations: np.ndarray | None = None
    std_mm: dict[str, np.ndarray] | None = None
    questions: frozenset[str] = frozenset()
    must_ask: frozenset[str] = frozenset()
    any_frame: bool = False
    readable: bool = True
    says: str = ""
    no_reading: frozenset[int] = field(default=frozenset())


Writer = Callable[[Path], Measured]
OPEN = frozenset()


def truth(
    files: Path | Sequence[Path],
    robot: str,
    joints_deg: np.ndarray,
    points_mm: np.ndarray | dict[str, np.ndarray],
    *,
    missing: Iterable[int] = (),
    **more: object,
) -> Measured:
    """Truth of a file whose joints are in degrees; rows in `missing` hold no reading."""
    gone = sorted(missing)
    targets = points_mm if isinstance(points_mm, dict) else {"": points_mm}
    targets = {name: np.array(points, dtype=float) for name, points in targets.items()}
    for points in targets.values():
        points[gone] = np.nan
    paths = (files,) if isinstance(files, Path) else tuple(files)
    return Measured(
        paths, robot, np.radians(joints_deg), targets, no_reading=frozenset(gone), **more
    )


def plain(value: float, decimals: int) -> str:
    """A number as most software writes it."""
    return f"{value:.{decimals}f}"


def comma(value: float, decimals: int) -> str:
    """A number with a decimal comma."""
    return plain(value, decimals).replace(".", ",")


def grouped(value: float, decimals: int) -> str:
    """A number with commas between thousands."""
    return f"{value:,.{decimals}f}"


def grouped_german(value: float, decimals: int) -> str:
    """A number with points between thousands and a decimal comma."""
    return grouped(value, decimals).translate(str.maketrans(",.", ".,"))


def grouped_french(value: float, decimals: int) -> str:
    """A number with hard blanks between thousands and a decimal comma."""
    return grouped(value, decimals).translate(str.maketrans(",.", "\u00a0,"))


def grouped_swiss(value: float, decimals: int) -> str:
    """A number with apostrophes between thousands."""
    return grouped(value, decimals).replace(",", "'")


def true_minus(value: float, decimals: int) -> str:
    """A number with the typographic minus, as copied from a report."""
    return plain(value, decimals).replace("-", "\u2212")


Number = Callable[[float, int], str]


def cells(values: np.ndarray, decimals: int, number: Number = plain) -> list[list[str]]:
    """Rows of text from rows of numbers."""
    return [[number(value, decimals) for value in row] for row in values]


def beside(*parts: Sequence[Sequence[object]]) -> list[list[str]]:
    """Columns of several tables side by side."""
    return [[str(cell) for part in row for cell in part] for row in zip(*parts, strict=True)]


def column(values: Iterable[object]) -> list[list[str]]:
    """One column of text."""
    return [[str(value)] for value in values]


def save(path: Path, lines: Iterable[str], *, encoding: str = "utf-8", newline: str = "\n") -> Path:
    """Write lines as they stand."""
    path.write_bytes((newline.join(lines) + newline).encode(encoding))
    return path


def joined(rows: Iterable[Sequence[str]], separator: str) -> list[str]:
    """Rows of text with a separator between cells."""
    return [separator.join(row) for row in rows]


def euler(rotations: np.ndarray, sequence: str, decimals: int) -> tuple[np.ndarray, np.ndarray]:
    """Angles in degrees as written, and the rotations these stand for."""
    angles = Rotation.from_matrix(rotations).as_euler(sequence, degrees=True).round(decimals)
    return angles, Rotation.from_euler(sequence, angles, degrees=True).as_matrix()


def quaternions(rotations: np.ndarray, decimals: int) -> tuple[np.ndarray, np.ndarray]:
    """Quaternions as written, scalar first, and the rotations these stand for."""
    written = Rotation.from_matrix(rotations).as_quat(canonical=True)[:, [3, 0, 1, 2]]
    written = written.round(decimals)
    return written, Rotation.from_quat(written[:, [1, 2, 3, 0]]).as_matrix()


def kr10_description(folder: Path) -> str:
    """Path of the robot file of the arm that is not shipped."""
    return str(save(folder / "kr10.yaml", KR10_YAML.splitlines()))
