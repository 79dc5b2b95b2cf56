"""What a study found, in few lines: differences of two models by population, claims counted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinacc.calibration.observations import TOOL
from kinacc.tables.allowed import VERDICTS

_VERDICTS = dict(zip(VERDICTS, ("agree", "differ", "cannot be compared"), strict=True))


def differences(
    points: Mapping, measurements: Mapping, accuracy_map: Mapping | None = None
) -> list[str]:
    """The largest errors of the map and of the operating points, each population in a line."""
    lines = []
    targets = list(dict.fromkeys(map(str, measurements["target"])))
    each = f", of {', '.join(targets)}" if len(targets) > 1 else ""
    modelled = _of_tool(targets)
    if accuracy_map is not None:
        largest = accuracy_map["position_max_mm"]
        cells = np.isfinite(largest)
        if cells.any():
            where = f"over the evaluation space ({cells.sum()} cells)"
            told = f"map error: at most {largest[cells].max():.3f} mm {where}, DH to VEC"
            lines.append(told + modelled)
    error, count = float(np.max(points["true_error_mm"])), len(points["point"])
    told = f"operating-point error: at most {error:.3f} mm at the {count} points of the study"
    if are_measured(points, measurements):
        told += f": measured poses, so it is a held-out error of DH, of mean readings{each}"
        return [*lines, told]
    return [*lines, f"{told}, DH to VEC{modelled}"]


def _of_tool(targets: Sequence[str]) -> str:
    """Which point errors between models are of, where several targets were measured."""
    if len(targets) < 2:
        return ""
    if TOOL in targets:
        return f", of target {TOOL} alone"
    told = f", of the tool of the robot's file, none of {', '.join(targets)}"
    return f"{told} (evaluation.tool_mm chooses another)"


def are_measured(points: Mapping, measurements: Mapping) -> bool:
    """Whether every operating point is at joints that were measured."""
    names = [name for name in points if name[:1] == "q" and name[1:].isdigit()]
    measured = set(zip(*(np.asarray(measurements[name]).tolist() for name in names), strict=True))
    wanted = zip(*(np.asarray(points[name]).tolist() for name in names), strict=True)
    return all(each in measured for each in wanted)


def claims_counted(claims: Mapping) -> str:
    """How many of the paper's claims have which verdict, without those that chose a reading."""
    chose = np.asarray(claims["used_to_choose"], dtype=bool)
    verdicts = list(claims["verdict"][~chose])
    told = ", ".join(f"{verdicts.count(name)} {words}" for name, words in _VERDICTS.items())
    told = f"of {len(verdicts)} claims {told}"
    return f"{told}; {chose.sum()} that chose a reading are not counted" if chose.any() else told


def claims_that_differ(claims: Mapping) -> list[str]:
    """Ids of the claims that the results contradict, without those that chose a reading."""
    counted = (claims["verdict"] == VERDICTS[1]) & ~np.asarray(claims["used_to_choose"], dtype=bool)
    return [str(claim) for claim in claims["claim"][counted]]
