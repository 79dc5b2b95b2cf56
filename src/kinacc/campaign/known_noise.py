"""The noise that a repeatability test told, as ``kinacc repeatability -o noise.json`` left it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinacc.assess.adaptive import covariance_faults
from kinacc.assess.noise import ENOUGH, FEWEST
from kinacc.config import json_files
from kinacc.errors import InputError, Problem, refuse

FORMAT = "kinacc repeatability 1"
_FIX = "write it with kinacc repeatability FILE -o noise.json"


@dataclass(frozen=True)
class KnownNoise:
    """Covariance (3, 3), mm^2, of a reading, right up to one factor of ``freedom`` degrees.

    In the frame of the readings it was told by. ``source``: their file; ``poses_differ``: that some
    poses scatter more than others, empty where that is not shown.
    """

    covariance_mm2: np.ndarray
    freedom: int
    source: str
    poses_differ: str


def read(path: str | Path) -> KnownNoise:
    """The noise of a file. Raises InputError where it tells none."""
    path = Path(path)
    if not path.is_file():
        raise InputError(Problem(f"--repeatability {path}", "no such file", fix=_FIX))
    problem = Problem(f"--repeatability {path}", "is no answer of kinacc repeatability", fix=_FIX)
    try:
        content = json_files.values_of(json_files.bytes_of(path), str(path))
        if not isinstance(content, Mapping) or content.get("format") != FORMAT:
            raise InputError(problem)
        noise = content["noise"]
        if noise is None:
            what = "tells no noise: no pose was left and come back to"
            raise InputError(Problem(f"--repeatability {path}", what, fix=_FIX))
        covariance = np.array(noise["covariance_mm2"], dtype=float).reshape(3, 3)
        freedom, source = int(float(noise["freedom"])), str(content["file"])
        poses_differ = str(content["poses_differ"] or "")
    except (ArithmeticError, LookupError, TypeError, ValueError):
        raise InputError(problem) from None
    wrong = [said for _, said in covariance_faults(covariance[None])]
    problems = [Problem(f"--repeatability {path}", said, fix=_FIX) for said in wrong]
    if freedom < FEWEST:
        what, allowed = (
            f"{freedom} degrees of freedom",
            f"at least {FEWEST}; {ENOUGH} are asked for",
        )
        fix = f"visit more poses of {source} again, leaving them between, and {_FIX}"
        problems.append(Problem(f"--repeatability {path}", what, allowed, fix))
    refuse(problems)
    return KnownNoise(covariance, freedom, source, poses_differ)


def doubts(known: KnownNoise | None) -> list[Problem]:
    """What speaks against beginning a campaign with a noise; nothing where none was tested."""
    if known is None or not known.poses_differ:
        return []
    fix = "state the largest with --noise-mm; --sure takes that of all poses together"
    return [Problem(f"--repeatability, {known.source}", known.poses_differ, fix=fix)]
