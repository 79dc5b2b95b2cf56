"""Tools and bases by number in a YAML file."""

from __future__ import annotations

import numpy as np
import yaml

from kinacc.deployment.programs.orientation import Convention
from kinacc.deployment.programs.record import BASE, TOOL, Frames, Source
from kinacc.errors import InputError, Problem


def frames_of(source: Source, convention: Convention) -> Frames:
    """Frames of ``tools: {1: [six numbers]}``, ``bases: {1: [..]}``, in mm and degrees."""
    try:
        content = yaml.safe_load(source.text)
        return {
            (kind, str(number)): convention.typed(np.array(numbers, float))
            for kind in (TOOL, BASE)
            for number, numbers in content.get(f"{kind}s", {}).items()
        }
    except (yaml.YAMLError, AttributeError, TypeError, ValueError):
        allowed = "tools: {1: [six numbers]}, bases: {1: [six numbers]}"
        raise InputError(Problem(str(source.path), "is no file of frames", allowed)) from None
