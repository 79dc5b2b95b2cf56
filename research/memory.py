"""Stages of many configurations, one after another: what two of them share is made once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kinacc.study.in_memory import lean
from kinacc.workflow.code import config_hash
from research.dotted import value_at

_EVALUATION = tuple(
    f"evaluation.{key}"
    for key in ("cylinder", "reference_orientation_deg", "reference_frame", "rotation_deg",
                "rotations", "tool_mm", "invert_with", "travel_direction")
)  # fmt: skip
_FIT = ("robot", "calibration.rotation_weight_mm_per_rad", "calibration.base_and_tool",
        "calibration.frames")  # fmt: skip
_STUDY = ("study.measurements", "study.alpha", "study.visiting_order", "study.distance",
          "study.covariance")  # fmt: skip
# Settings that a stage depends on, and stages whose tables it reads.
STAGES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "measurements": (("seed", "robot", "measurements", *_EVALUATION[1:3]), ()),
    "vec": ((*_FIT, "calibration.vec"), ("measurements",)),
    "dh": ((*_FIT, "calibration.dh"), ("measurements", "vec")),
    "residuals": (("robot", "calibration"), ("measurements", "vec", "dh")),
    "accuracy_map": (("robot", *_EVALUATION, "map"), ("vec", "dh")),
    "assessment_points": (("robot", "evaluation"), ("measurements", "vec", "dh", "residuals")),
    "study_chunk": (
        ("seed", "study.noise_mm", "study.repetitions", "study.outlier_rule", "study.search",
         *_STUDY),
        ("assessment_points",),
    ),
    "study": (("study",), ("study_chunk", "assessment_points")),
    "histories": (("seed", "histories", *_STUDY), ("assessment_points",)),
}  # fmt: skip


def settings_of(name: str, config: Mapping) -> dict[str, object]:
    """Settings that a stage depends on, by key path."""
    return {path: value_at(config, path) for path in STAGES[name][0]}


class Memory:
    """Results of stages, kept for configurations that share their settings."""

    def __init__(self, kept: int = 32) -> None:
        """``kept``: how many results of a stage are held at a time."""
        self.kept = kept
        self.made: dict[str, dict[tuple, dict]] = {}

    def fill(self, tables: dict, names: Sequence[str], config: Mapping) -> None:
        """Add to ``tables``, empty at first, what the stages ``names`` make under ``config``.

        Where a stage raises InputError, ``tables`` holds what those before it made.
        """
        origin: dict[str, tuple] = {}
        for name in names:
            read = [each for each in STAGES[name][1] if each in origin]
            key = (config_hash(settings_of(name, config)), *(origin[each] for each in read))
            known = self.made.setdefault(name, {})
            known[key] = known.pop(key) if key in known else lean(name, config, tables)
            for old in list(known)[: -self.kept]:
                del known[old]
            tables |= known[key]
            origin[name] = (name, key)
