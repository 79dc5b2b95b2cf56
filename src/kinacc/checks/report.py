"""The report of a file: what is there, and every suspicion, for people and for machines."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from kinacc.checks.suspicion import STOPS, Suspicion

CLEAN, SUSPICIOUS, UNUSABLE = 0, 1, 2
VERDICTS = ("clean", "suspicions", "unusable")


@dataclass(frozen=True)
class Report:
    """What ``kinacc check-data`` says of one data set.

    ``facts`` are what is there, ``remarks`` what to know about it, in words; ``notes`` say where
    the data are thin. ``accepted`` are kinds of suspicions the configuration goes on with, each
    with its reason. For a picture: ``line`` (n,) of the readings as compared and ``left_mm`` (n,)
    what a quick fit leaves of each, empty where nothing was fitted.
    """

    dataset: str
    path: str
    facts: Mapping[str, object]
    remarks: tuple[str, ...]
    suspicions: tuple[Suspicion, ...]
    notes: tuple[Suspicion, ...] = ()
    line: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    left_mm: np.ndarray = field(default_factory=lambda: np.empty(0))
    accepted: Mapping[str, str] = field(default_factory=dict)

    @property
    def findings(self) -> tuple[Suspicion, ...]:
        """Suspicions and notes."""
        return (*self.suspicions, *self.notes)

    @property
    def stopping(self) -> tuple[Suspicion, ...]:
        """The suspicions that stop a workflow, unless they are accepted."""
        return tuple(e for e in self.suspicions if e.level == STOPS and e.kind not in self.accepted)

    @property
    def code(self) -> int:
        """0 clean, 1 with suspicions."""
        return SUSPICIOUS if self.suspicions else CLEAN

    def as_dict(self) -> dict[str, object]:
        """For JSON: every suspicion with all its lines."""
        return {
            "dataset": self.dataset,
            "path": self.path,
            "verdict": VERDICTS[self.code],
            "facts": plain(self.facts),
            "remarks": [*self.remarks, *(each.what for each in self.notes)],
            "suspicions": [
                {
                    "kind": each.kind,
                    "level": each.level,
                    "accepted": self.accepted.get(each.kind),
                    "what": each.what,
                    "fix": each.fix,
                    "lines": list(each.lines),
                    "where": each.where if each.lines else None,
                    **plain(each.values),
                }
                for each in self.suspicions
            ],
        }

    def as_text(self) -> str:
        """For people."""
        lines = [f"{self.dataset}: {self.path}", ""]
        for name, value in self.facts.items():
            lines += _fact(name.replace("_", " "), value)
        lines += ["", *(f"note: {remark}" for remark in self.remarks)]
        lines += [f"note: {each.what}" for each in self.notes]
        if not self.suspicions:
            return "\n".join([*lines, "", "nothing suspicious"])
        count = len(self.suspicions)
        stop = len(self.stopping)
        stops = f"{stop} of which stop{'s' if stop == 1 else ''} the workflow" if stop else ""
        whether = stops or "none of which stops the workflow"
        lines += ["", f"{count} suspicion{'s' if count > 1 else ''}, {whether}"]
        for each in self.suspicions:
            lines.append(f"  - {each.kind}: {each.what}")
            lines += [f"    {each.where}"] if each.lines else []
            lines += [f"    {each.fix}"] if each.fix else []
            if each.kind in self.accepted:
                lines.append(f"    accepted (data_check.accept): {self.accepted[each.kind]}")
            elif each.level == STOPS:
                lines.append("    stops the workflow")
        return "\n".join(lines)


_MEANT = {"most_expected_mm": "a reading farther off is an outlier"}


def _fact(name: str, value: object) -> list[str]:
    if name == "joint coverage":
        return [f"  {name}", *(f"    {_covered(joint)}" for joint in value)]
    if isinstance(value, Mapping):
        told = {key: f" ({_MEANT[key]})" if key in _MEANT else "" for key in value}
        rows = [f"    {key}: {_by_axis(each)}{told[key]}" for key, each in value.items()]
        return [f"  {name}", *rows]
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        rows = [", ".join(f"{k} {_word(v)}" for k, v in row.items()) for row in value]
        return [f"  {name}", *(f"    {row}" for row in rows)]
    return [f"  {name}: {_word(value)}"]


def _covered(joint: Mapping) -> str:
    return (
        f"joint {joint['joint']}: {joint['low']:.1f} to {joint['high']:.1f} {joint['unit']}, "
        f"{100 * joint['share']:.0f} % of its limits {joint['least']:g} to {joint['most']:g}"
    )


def _by_axis(value: object) -> str:
    """A value of a fact; of three numbers, which are per axis of the instrument, each named."""
    if not isinstance(value, list):
        return _word(value)
    named = (f"{axis} {_word(each)}" for axis, each in zip("xyz", value, strict=True))
    return f"{', '.join(named)} (axes of the instrument)"


def _word(value: object) -> str:
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return "unknown"
    if isinstance(value, float):
        return f"{value:.3g}"
    if isinstance(value, (list, tuple)):
        return " ".join(_word(each) for each in value)
    return str(value)


def plain(value: object) -> object:
    """Plain numbers, texts and lists for JSON; what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(each) for each in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value


def to_json(reports: list[dict]) -> str:
    """All data sets in one object, with the worst verdict."""
    worst = max((VERDICTS.index(each["verdict"]) for each in reports), default=0)
    return json.dumps({"verdict": VERDICTS[worst], "datasets": reports}, indent=1)
