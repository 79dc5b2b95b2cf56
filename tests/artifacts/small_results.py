"""A small, complete and consistent results folder to plant faults in."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import numpy as np
from kinacc.workflow.catalogue import HISTORY, STAGES
from kinacc.workflow.plan import Plan
from kinacc.workflow.runner import Job, stage_provenance

from kinacc.artifacts import allowed, records, store
from kinacc.artifacts.contract import PROVENANCE_KEYS

SEED = 7
NOISE_MM = (0.05, 0.3)
REPETITIONS = 3
PICTURES = {
    "svg": b"<?xml version='1.0'?>\n<svg><!--IN\0--></svg>\n",
    "png": b"\x89PNG\r\n\x1a\n" + b"\x00" * 8 + b"IN\0" + b"IEND\xaeB`\x82",
    "pdf": b"%PDF-1.4\nIN\0\n%%EOF\n",
}
PAGE = b"<!DOCTYPE html>\n<html>IN\0</html>\n"


class SmallResults:
    """One data set's folder; ``tables`` are what is written, ``save`` writes one again."""

    def __init__(self, folder: Path, plan: Plan | None = None):
        self.plan = plan
        self.files: dict[str, str] = {}
        self.root, self.folder = folder, folder / "mh180"
        self.tables = small_tables()
        for name, stage in STAGES.items():
            if stage.leaves != "tables":
                if not (stage.on_request or name in HISTORY):
                    self.leave(name)
            elif not stage.on_request and all(each in self.tables for each in stage.outputs):
                self.save(name)

    def path(self, artefact: str) -> Path:
        return self.folder / f"{artefact}.parquet"

    def parts(self) -> list[Path]:
        return [self.folder / "study_chunk" / f"{k}-of-2.parquet" for k in (1, 2)]

    def marks(self, stage_name: str, without: tuple[str, ...] = ()) -> dict:
        stage = STAGES[stage_name]
        inputs = {}
        for name in (*stage.inputs, *stage.optional):
            if name == "study_chunk":
                inputs[name] = [str(path) for path in self.parts()]
            elif name not in without and self.path(name).exists():
                inputs[name] = str(self.path(name))
        inputs |= self.files if STAGES[stage_name].files else {}
        if self.plan is None:
            return stage_provenance(Job(stage.module, inputs, {}, {}, SEED))
        settings = self.plan.settings(stage_name, "mh180")
        return stage_provenance(Job(stage.module, inputs, {}, settings, self.plan.seed("mh180")))

    def save(self, stage_name: str, without: tuple[str, ...] = ()) -> None:
        """Write the tables of a stage and its record, made from what is there now."""
        marks = self.marks(stage_name, without)
        if stage_name == "study_chunk":
            for number, path in enumerate(self.parts()):
                rows = np.asarray(self.tables[stage_name]["repetition"]) % 2 == number
                part = {k: np.asarray(v)[rows] for k, v in self.tables[stage_name].items()}
                self._record(
                    stage_name, path.stem, marks, {path: _content(stage_name, part, marks)}
                )
            return
        tables = {
            self.path(name): _content(name, self.tables[name], marks)
            for name in STAGES[stage_name].outputs
        }
        self._record(stage_name, None, marks, tables)

    def leave(self, name: str) -> None:
        """Pictures or a page with what they were made from."""
        files = {self.folder / f"{name}.html": ("html", PAGE)}
        if STAGES[name].is_figure:
            paths = {kind: self.folder / "figures" / f"{name}.{kind}" for kind in PICTURES}
            files = {path: (kind, PICTURES[kind]) for kind, path in paths.items()}
        marks = self.marks(name)
        told = f"inputs_digests {marks['inputs_digests']}".encode()
        read = "".join(
            f'<meta name="kinacc:read:{role}" content="{digest}">'
            for role, digest in json.loads(marks["inputs_digests"]).items()
        )
        contents = {
            path: (content.replace(b"IN\0", read.encode() if kind == "html" else told), None)
            for path, (kind, content) in files.items()
        }
        self._record(name, None, marks, contents)

    def _record(self, name: str, part: str | None, marks: dict, files: dict) -> None:
        kept = {key: str(marks[key]) for key in PROVENANCE_KEYS}
        record = records.Record(name, part, kept, json.loads(marks["inputs_digests"]), {})
        place = records.place(self.folder, name, part)
        records.leave(place, record, {str(path): told for path, told in files.items()})

    def change(self, stage_name: str, artefact: str, **columns) -> None:
        """Change columns of one table and make everything that follows from it again."""
        self.tables[artefact] = self.tables[artefact] | columns
        names = list(STAGES)
        for name in names[names.index(stage_name) :]:
            if STAGES[name].on_request or STAGES[name].measured or name in HISTORY:
                continue
            if STAGES[name].leaves != "tables":
                self.leave(name)
            elif set(STAGES[name].outputs) <= set(self.tables):
                self.save(name)


def _content(artefact: str, columns: dict, marks: dict) -> tuple[bytes, str]:
    table = store.to_table(artefact, columns, marks)
    return store.content_of(table), store.columns_digest(table)


def small_tables() -> dict[str, dict]:
    tables = {**_measured(), **_models(), **_residuals(), **_map(), **_study()}
    tables["summary"] = {
        "topic": ["data", "data"],
        "item": ["measurements", "measurements"],
        "statistic": ["source", "readings"],
        "value": [np.nan, 4.0],
        "unit": [None, "1"],
        "text": ["synthetic", None],
    }
    tables["claims"] = {
        "claim": ["table_1.mean", "spread_even"],
        "statement": ["The mean is 0.705 mm.", "The spread is even about the mean."],
        "statistic": ["mean of the residuals", "ratio of both sides"],
        "evidence": ["residuals.parquet", "study.parquet, study_summary.parquet"],
        "paper": [0.705, np.nan],
        "reproduced": [0.71, 1.2],
        "tolerance": [0.07, np.nan],
        "verdict": ["agrees", "differs"],
        "share": [1.0, np.nan],
    }
    return tables


def _quaternions(count: int) -> dict:
    half = np.linspace(0.0, 1.0, count)
    return {"qw": np.cos(half), "qx": np.sin(half), "qy": np.zeros(count), "qz": np.zeros(count)}


def _joints(count: int) -> dict:
    joints = {f"q{j}": np.linspace(-1.0, 1.0, count) / j for j in range(1, 7)}
    return joints | {f"s{j}": np.zeros(count, dtype=int) for j in range(1, 7)}


def _measured() -> dict:
    count = 4
    measurements = {
        "pose": np.arange(count),
        **_joints(count),
        "target": ["tool"] * count,
        **{f"{axis}_mm": np.arange(count) * 10.0 for axis in "xyz"},
        **_quaternions(count),
        "repeat": np.zeros(count),
        "subset": ["validation", "train", "train", "train"],
        "fold": [0, 1, 1, 1],
    }
    described = {"name": ["mh180"], "source": [None], "date": [None], "description": ["dh: []"]}
    return {"measurements": measurements, "robot": described}


def _dh(count: int) -> dict:
    names = ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad", "beta_rad")
    return {name: np.zeros(count) for name in names}


def _frame_table(models: tuple[str, ...]) -> dict:
    pairs = list(product(models, ("base", "tool")))
    return {
        "model": [model for model, _ in pairs],
        "frame": [frame for _, frame in pairs],
        **{f"{axis}_mm": np.zeros(len(pairs)) for axis in "xyz"},
        "qw": np.ones(len(pairs)),
        **{f"q{axis}": np.zeros(len(pairs)) for axis in "xyz"},
    }


def _models() -> dict:
    terms = list(product(range(1, 7), allowed.ERRORS))
    joints = np.arange(1, 7)
    fit = {
        "quantity": ["rank", "singular_value", "singular_value"],
        "number": [None, 1, 2],
        "parameter": [None, None, None],
        "value": [2.0, 1.0, 0.5],
        "unit": ["1", "1", "1"],
    }
    covariance = {
        "parameter": ["j1.d_mm", "j2.d_mm", "j2.d_mm"],
        "other": ["j1.d_mm", "j1.d_mm", "j2.d_mm"],
        "covariance": [1e-4, 1e-5, 4e-4],
        "correlation": [1.0, None, 1.0],
    }
    return {
        "vec_model": {
            "joint": [joint for joint, _ in terms],
            "error": [error for _, error in terms],
            "direction": np.zeros(len(terms)),
            "order": np.zeros(len(terms)),
            "coefficient": np.full(len(terms), 0.01),
            "std": np.full(len(terms), 0.001),
            "q_min_rad": np.full(len(terms), -1.0),
            "q_max_rad": np.full(len(terms), 1.0),
            **_dh(len(terms)),
        },
        "vec_frames": _frame_table(("vec",)),
        "vec_fit": fit,
        "vec_covariance": covariance,
        "vec_orders": {
            "fold": [np.nan],
            "order": [0],
            "prior_std_mm": [1.0],
            "prior_std_mrad": [1.0],
            "prior_decay": [1.0],
            "held_out_rms_mm": [np.nan],
            "excess_mm2": [np.nan],
            "excess_std_error_mm2": [np.nan],
            "chosen": [1],
        },
        "dh_model": {
            "joint": joints,
            **_dh(6),
            **{f"std_{name}": np.full(6, np.nan) for name in _dh(6)},
        },
        "frames": _frame_table(("vec", "dh", "nominal")),
        "dh_fit": fit,
        "dh_covariance": covariance,
        "dh_identified": {
            "parameter": ["j1.d_mm", "j2.d_mm"],
            "status": ["identified", "undetermined"],
            "std": [0.01, np.nan],
            "unit": ["mm", "mm"],
            "undetermined_share": [0.0, 0.7],
            "statement": [None, "d of joint 2 and d of joint 3 appear only as their difference"],
        },
    }


def _residuals() -> dict:
    return {"residuals": _statistics(), "pose_errors": _error_vectors(), **_worth()}


def _worth() -> dict:
    vector = {"ex_mm": [0.8], "ey_mm": [0.0], "ez_mm": [0.0]}
    about = {"comparison": ["dh_vs_measured"], "estimate": ["cross_validated"]}
    region = {"joint": [1], "from_rad": [-1.0], "to_rad": [1.0], "n": [4]}
    errors = {f"std_error_{axis}_mm": [0.1] for axis in "xyz"}
    place = {"rank": [1], "row": [0], "line": [None], "pose": [0], "target": ["tool"]}
    return {
        "model_selection": {
            "model": ["dh", "vec"],
            "selected": [0, 1],
            "held_out_rms_mm": [0.5, 0.4],
            "mean_of_folds_mm": [0.5, 0.4],
            "gain_mm2": [0.0, 0.09],
            "gain_std_error_mm2": [0.0, 0.01],
            "configurations": [4, 4],
        },
        "joint_bias": {**about, **region, **vector, **errors, "rms_mm": [0.8]},
        "worst_rows": {**about, **place, **vector, "error_mm": [0.8]},
    }


_LENGTHS = {"train": np.array([0.2, 0.4, 0.6]), "cross_validated": np.array([0.8, 0.2, 0.4, 0.6])}


def _statistics() -> dict:
    kinds = list(product(allowed.COMPARISONS, allowed.SUBSETS, allowed.QUANTITIES))
    values = [_LENGTHS["train" if kind[1] == "train" else "cross_validated"] for kind in kinds]
    return {
        "comparison": [kind[0] for kind in kinds],
        "subset": [kind[1] for kind in kinds],
        "fold": [None] * len(kinds),
        "quantity": [kind[2] for kind in kinds],
        "unit": ["mm" if kind[2] == "position" else "mrad" for kind in kinds],
        "n": [each.size for each in values],
        "mean": [each.mean() for each in values],
        "max": [each.max() for each in values],
        "rms": [np.sqrt(np.mean(each**2)) for each in values],
        "gamma99": [0.9] * len(kinds),
    }


def _error_vectors() -> dict:
    rows = [
        (comparison, estimate, row, length)
        for comparison in allowed.COMPARISONS
        for estimate, first in (("train", 1), ("cross_validated", 0))
        for row, length in enumerate(_LENGTHS[estimate], first)
    ]
    lengths = np.array([row[3] for row in rows])
    return {
        "comparison": [row[0] for row in rows],
        "estimate": [row[1] for row in rows],
        "row": [row[2] for row in rows],
        "pose": [row[2] for row in rows],
        "target": ["tool"] * len(rows),
        "repeat": np.zeros(len(rows)),
        "subset": ["train" if row[2] else "validation" for row in rows],
        "fold": [min(row[2], 1) for row in rows],
        "ex_mm": lengths,
        "ey_mm": np.zeros(len(rows)),
        "ez_mm": np.zeros(len(rows)),
        "rx_mrad": np.zeros(len(rows)),
        "ry_mrad": lengths,
        "rz_mrad": np.zeros(len(rows)),
    }


def _map() -> dict:
    return {
        "accuracy_map": {
            "slice_deg": [0.0, 0.0],
            "radius_mm": [1200.0, 1225.0],
            "height_mm": [0.0, 0.0],
            "position_max_mm": [0.5, None],
            "orientation_max_mrad": [1.5, None],
            "worst_branch": ["X+ Y- Z0, front-up-flip", None],
            "orientation_worst_branch": ["X+ Y- Z0, front-up-flip", None],
            "solutions": [18, 0],
            "wanted": [18, 18],
            "extrapolating": [0, 0],
            **{f"q{joint}": [0.1 * joint, None] for joint in range(1, 7)},
        }
    }


def _study() -> dict:
    error = np.array([0.1, 0.2, 0.3])
    points = {
        "point": np.arange(3),
        **_joints(3),
        "ex_mm": error,
        "ey_mm": np.zeros(3),
        "ez_mm": np.zeros(3),
        "true_error_mm": error,
    }
    runs = list(product(NOISE_MM, range(REPETITIONS), allowed.ASSESSORS))
    study = {
        "noise_mm": [run[0] for run in runs],
        "repetition": [run[1] for run in runs],
        "assessor": [run[2] for run in runs],
        "assessed_mm": 0.3 + 0.01 * np.arange(len(runs)),
        "measurements": [3] * len(runs),
        "points_visited": [3] * len(runs),
        "lower_mm": [None] * len(runs),
        "upper_mm": [None] * len(runs),
    }
    switches = {name: [None] * len(runs) for name in _SWITCHES}
    cells = list(product(allowed.ASSESSORS, NOISE_MM))
    values = [
        study["assessed_mm"][[run[2] == assessor and run[0] == noise for run in runs]]
        for assessor, noise in cells
    ]
    summary = {
        "assessor": [cell[0] for cell in cells],
        "noise_mm": [cell[1] for cell in cells],
        "mean_mm": [each.mean() for each in values],
        "min_mm": [each.min() for each in values],
        "max_mm": [each.max() for each in values],
        "bias_mm": [each.mean() - 0.3 for each in values],
        "rmse_mm": [np.sqrt(np.mean((each - 0.3) ** 2)) for each in values],
        "repetitions": [REPETITIONS] * len(cells),
    }
    return {
        "assessment_points": points,
        "study_chunk": study | switches,
        "study": study,
        "study_summary": summary,
        "readings": _readings(summary),
        "histories": _histories(),
    }


_SWITCHES = ("outlier_rule", "distance", "covariance", "search")


def _readings(summary: dict) -> dict:
    rows = [("outlier_rejection", rule, None, None, None) for rule in allowed.OUTLIER_RULES]
    rows += [
        ("model_invalidation", None, *switches)
        for switches in product(allowed.DISTANCES, allowed.COVARIANCES, allowed.SEARCHES)
    ]
    rows = [(*row, noise) for noise in NOISE_MM for row in rows]
    names = ("assessor", *_SWITCHES, "noise_mm")
    table = {name: [row[i] for row in rows] for i, name in enumerate(names)}
    cells = list(zip(summary["assessor"], summary["noise_mm"], strict=True))
    at = [cells.index((row[0], row[-1])) for row in rows]
    numbers = ("mean_mm", "min_mm", "max_mm", "bias_mm")
    return table | {name: [summary[name][i] for i in at] for name in numbers}


def _histories() -> dict:
    steps = [(0, 1), (1, 1), (1, 2)]
    rows = [
        (example, i, *step)
        for example in ("rejected", "not_rejected")
        for i, step in enumerate(steps)
    ]
    error = np.array([0.1, 0.2])
    count = len(rows)
    return {
        "example": [row[0] for row in rows],
        "noise_mm": np.full(count, 0.3),
        "alpha": np.full(count, 0.6),
        "simulation": np.zeros(count),
        "rule": ["first simulation"] * count,
        "rule_met": np.ones(count),
        "distance": ["squared"] * count,
        "covariance": ["r"] * count,
        "iteration": [row[1] + 1 for row in rows],
        "point": [row[2] for row in rows],
        "repeat": [row[3] for row in rows],
        "eta_mm": np.full(count, 0.25),
        "measured_mm": np.full(count, 0.4),
        "averaged_mm": np.full(count, 0.4),
        "true_mm": [error[row[2]] for row in rows],
        "rejection_probability": np.full(count, 0.5),
    }
