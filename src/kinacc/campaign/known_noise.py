"""The noise that a repeatability test told, as ``kinacc repeatability -o noise.json`` left it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, FiniteFloat

from kinacc.assess.adaptive import covariance_faults
from kinacc.assess.noise import ENOUGH, FEWEST
from kinacc.config import json_files
from kinacc.errors import InputError, Problem, refuse

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


class _Noise(BaseModel):
    covariance_mm2: list[list[FiniteFloat]]
    freedom: FiniteFloat


class _File(BaseModel):
    format: Literal["kinacc repeatability 1"]
    file: str
    noise: _Noise | None
    poses_differ: str | None


def read(path: str | Path) -> KnownNoise:
    """Return the noise of a file that ``kinacc repeatability -o`` wrote.

    Parameters
    ----------
    path : path
        JSON file.

    Returns
    -------
    KnownNoise
        Covariance in mm^2 in the frame of its readings, with its degrees of freedom.

    Raises
    ------
    InputError
        Where the file holds no noise, or too few degrees of freedom.
    """
    where = f"--repeatability {path}"
    try:
        content = _File.model_validate(json_files.values_of(json_files.bytes_of(path), str(path)))
        covariance = np.array(content.noise.covariance_mm2 if content.noise else np.eye(3))
        covariance = covariance.reshape(3, 3)
    except OSError:
        raise InputError(Problem(where, "no such file", fix=_FIX)) from None
    except (RecursionError, ValueError):
        message = "is no answer of kinacc repeatability"
        raise InputError(Problem(where, message, fix=_FIX)) from None
    if content.noise is None:
        raise InputError(Problem(where, "has no noise: no pose was visited again", fix=_FIX))
    problems = [Problem(where, fault, fix=_FIX) for _, fault in covariance_faults(covariance[None])]
    freedom = int(content.noise.freedom)
    if freedom < FEWEST:
        allowed = f"at least {FEWEST}; {ENOUGH} are wanted"
        problems.append(Problem(where, f"{freedom} degrees of freedom", allowed, _FIX))
    refuse(problems)
    return KnownNoise(covariance, freedom, content.file, content.poses_differ or "")


def doubts(known: KnownNoise | None) -> list[Problem]:
    """What speaks against beginning a campaign with a noise; nothing where none was tested."""
    if known is None or not known.poses_differ:
        return []
    fix = "state the largest with --noise-mm; --sure takes that of all poses together"
    return [Problem(f"--repeatability, {known.source}", known.poses_differ, fix=fix)]
