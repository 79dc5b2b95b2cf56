"""Runs of a small data set written by hand: tables, and records of what they were made of."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from kinacc.artifacts import provenance, records, store
from kinacc.artifacts.columns import Columns
from kinacc.kinematics import robot
from kinacc.workflow.catalogue import STAGES

# Stages that follow each other, with what they read.
READS = {
    "measurements": (),
    "dh": ("measurements",),
    "residuals": ("measurements", "dh_model", "frames"),
    "assessment_points": ("dh_model", "frames"),
    "study_chunk": ("assessment_points",),
    "study": ("study_chunk", "assessment_points"),
    "claims": ("residuals", "study_summary"),
}
KEYS = {
    "measurements": {"seed": 1, "measurements": {"file": {"path": "march.csv"}}},
    "dh": {"calibration": {"dh": {"truncation": 0.01}}},
    "residuals": {"calibration": {"dh": {"truncation": 0.01}}},
    "assessment_points": {"evaluation": {"points": 3}},
    "study_chunk": {"seed": 1, "study": {"repetitions": 40, "noise_mm": [0.1, 0.3]}},
    "study": {"study": {"search": "from_above"}},
    "claims": {"robot": "mh180"},
}
POSES = 6
_DH = ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad", "beta_rad")


def of(text: str) -> str:
    """A digest."""
    return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class Run:
    """What a run is made of; ``tables`` are what stages leave, the study's by its settings."""

    tables: Mapping[str, Columns] = field(default_factory=lambda: tables())
    data: str = "march"
    keys: Mapping[str, Mapping] = field(default_factory=lambda: KEYS)
    code: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=lambda: {"python": "3.12", "numpy": "2.1"})
    kinacc: str = "0.1.0"
    told: bool = True

    def with_table(self, artefact: str, **columns: object) -> Run:
        """The same with other values in columns of one table."""
        own = {name: np.asarray(values) for name, values in columns.items()}
        return replace(self, tables={**self.tables, artefact: {**self.tables[artefact], **own}})

    def with_code(self, stage: str, module: str) -> Run:
        """The same with another module in the code of a stage."""
        return replace(self, code={**self.code, stage: {module: of("changed")}})

    def with_keys(self, stage: str, **settings: object) -> Run:
        """The same with other settings of a stage."""
        return replace(self, keys={**self.keys, stage: {**self.keys[stage], **settings}})

    def write(self, results: Path, parts: int = 2) -> Path:
        """Its files in ``results``/arm, each stage made from what the one before left."""
        folder, digests = results / "arm", {}
        for stage, reads in READS.items():
            inputs = {name: digests[name] for name in reads}
            if stage == "measurements":
                inputs["measurements_file"] = of(self.data)
            for number in range(parts if STAGES[stage].scattered else 1):
                part = f"{number + 1}-of-{parts}" if STAGES[stage].scattered else None
                self._leave(folder, stage, part, inputs, (number, parts))
            for name in self._made(stage):
                table = store.to_table(name, self._columns(name), _NO_MARKS)
                digests[name] = store.columns_digest(table)
        return results

    def _leave(
        self,
        folder: Path,
        stage: str,
        part: str | None,
        inputs: Mapping[str, str],
        place: tuple[int, int],
    ) -> None:
        code = {"kinacc": of(self.kinacc), f"kinacc.workflow.stages.{stage}": of("as it was")}
        told = provenance.Code(code | self.code.get(stage, {}), self.versions)
        marks = {
            "kinacc_version": self.kinacc,
            "config_hash": provenance.config_hash(self.keys[stage]),
            "code_hash": told.folded(),
            "inputs_hash": provenance.inputs_hash(inputs),
            "seed": "1",
        }
        files = {}
        for name in self._made(stage):
            columns = self._columns(name)
            path = folder / f"{name}.parquet"
            if part:
                own = columns["repetition"] % place[1] == place[0]
                columns = {key: values[own] for key, values in columns.items()}
                path = folder / name / f"{part}.parquet"
            table = store.to_table(name, columns, marks)
            files[str(path)] = (store.content_of(table), store.columns_digest(table))
        more = (self.keys[stage], told.files, told.versions) if self.told else ()
        record = records.Record(stage, part, marks, dict(inputs), {}, *more)
        records.leave(records.place(folder, stage, part), record, files)

    def _made(self, stage: str) -> list[str]:
        return [name for name in STAGES[stage].outputs if name in (*self.tables, *_STUDY)]

    def _columns(self, artefact: str) -> Columns:
        if artefact not in _STUDY:
            return dict(self.tables[artefact])
        own = self.keys["study_chunk"]
        return _study(own["seed"], own["study"]["repetitions"])[artefact]


_NO_MARKS = dict.fromkeys(store.PROVENANCE_KEYS, "-")
_STUDY = ("study_chunk", "study", "study_summary", "claims")


def tables() -> dict[str, Columns]:
    """The tables of stages before the study: an arm as its maker describes it, its poses."""
    arm = robot.load("mh180")
    count = POSES
    joints = {f"q{j}": np.linspace(-0.9, 0.9, count) / j for j in range(1, 7)}
    joints |= {f"s{j}": np.zeros(count, dtype=int) for j in range(1, 7)}
    attitude = {"qw": np.ones(count), **{f"q{axis}": np.zeros(count) for axis in "xyz"}}
    place = {f"{axis}_mm": np.linspace(0.0, 900.0, count) for axis in "xyz"}
    about = {"repeat": np.zeros(count, int), "subset": ["train"] * count, "fold": [np.nan] * count}
    of_dh = {name: np.asarray(getattr(arm.dh, name)) for name in _DH}
    models = ("vec", "dh", "nominal")
    frames = [(model, frame) for model in models for frame in ("base", "tool")]
    error = np.array([0.1, 0.2, 0.3])
    points = {f"q{j}": np.zeros(3) for j in range(1, 7)} | {f"s{j}": [0] * 3 for j in range(1, 7)}
    return {
        "measurements": {
            "pose": np.arange(count),
            **joints,
            "target": ["tool"] * count,
            **place,
            **attitude,
            **about,
        },
        "robot": {
            "name": ["mh180"],
            "source": [None],
            "date": [None],
            "description": [robot.as_yaml(arm)],
        },
        "dh_model": {
            "joint": np.arange(1, 7),
            **of_dh,
            **{f"std_{name}": np.full(6, 0.01) for name in _DH},
        },
        "frames": {
            "model": [model for model, _ in frames],
            "frame": [frame for _, frame in frames],
            **{f"{axis}_mm": np.zeros(len(frames)) for axis in "xyz"},
            "qw": np.ones(len(frames)),
            **{f"q{axis}": np.zeros(len(frames)) for axis in "xyz"},
        },
        "dh_fit": {
            "quantity": ["rank", "gap", "singular_value", "singular_value"],
            "number": [np.nan, np.nan, 1, 2],
            "parameter": [None] * 4,
            "value": [30.0, 1e5, 9.0, 1.0],
            "unit": ["1", "1", "mm per mm or mrad", "mm per mm or mrad"],
        },
        "dh_covariance": {
            "parameter": ["j1.d_mm", "j2.alpha_rad", "j2.alpha_rad"],
            "other": ["j1.d_mm", "j1.d_mm", "j2.alpha_rad"],
            "covariance": [1e-4, 1e-8, 1e-10],
            "correlation": [1.0, 0.1, 1.0],
        },
        "residuals": {
            "comparison": ["dh_vs_measured"] * 2,
            "subset": ["train"] * 2,
            "fold": [np.nan, np.nan],
            "quantity": ["position", "orientation"],
            "unit": ["mm", "mrad"],
            "n": [count] * 2,
            "mean": [0.4, 0.9],
            "max": [0.8, 1.9],
            "rms": [0.5, 1.1],
            "gamma99": [0.9, np.nan],
        },
        "assessment_points": {
            "point": np.arange(3),
            **points,
            "ex_mm": error,
            "ey_mm": np.zeros(3),
            "ez_mm": np.zeros(3),
            "true_error_mm": error,
        },
    }


def _study(seed: int, repetitions: int) -> dict[str, Columns]:
    random = np.random.default_rng(seed)
    noises = (0.1, 0.3)
    noise = np.repeat(noises, repetitions)
    assessed = 0.3 + noise * random.standard_normal(noise.size) ** 2
    runs = {
        "noise_mm": noise,
        "repetition": np.tile(np.arange(repetitions), len(noises)),
        "assessor": ["maximum"] * noise.size,
    }
    found = {
        "assessed_mm": assessed,
        "measurements": np.full(noise.size, 3),
        "points_visited": np.full(noise.size, 3),
        "lower_mm": np.full(noise.size, np.nan),
        "upper_mm": np.full(noise.size, np.nan),
    }
    of_noise = [assessed[noise == each] for each in noises]
    switches = ("outlier_rule", "distance", "covariance", "search")
    nothing = {name: np.array([None] * noise.size, object) for name in switches}
    chunk = {**runs, **nothing, **found}
    summary = {
        "assessor": ["maximum"] * 2,
        "noise_mm": list(noises),
        "mean_mm": [each.mean() for each in of_noise],
        "min_mm": [each.min() for each in of_noise],
        "max_mm": [each.max() for each in of_noise],
        "bias_mm": [each.mean() - 0.3 for each in of_noise],
        "rmse_mm": [np.sqrt(np.mean((each - 0.3) ** 2)) for each in of_noise],
        "repetitions": [repetitions] * 2,
        "std_error_mm": [each.std(ddof=1) / np.sqrt(repetitions) for each in of_noise],
    }
    claims = {
        "claim": ["table_3.mean", "bias"],
        "statement": ["The mean is 0.4 mm.", "The bias is positive."],
        "statistic": ["mean", "bias"],
        "evidence": ["residuals.parquet", "study_summary.parquet"],
        "paper": [0.4, np.nan],
        "reproduced": [0.4, summary["bias_mm"][0]],
        "tolerance": [0.1, np.nan],
        "verdict": ["agrees", "agrees"],
        "share": [np.nan, np.nan],
    }
    return {
        "claims": claims,
        "study_chunk": {name: np.asarray(values) for name, values in chunk.items()},
        "study": {name: np.asarray(values) for name, values in {**runs, **found}.items()},
        "study_summary": {name: np.asarray(values) for name, values in summary.items()},
    }


def put_in(source: Path, target: Path, *names: str) -> None:
    """Files of a data set in the place of those of another."""
    for name in names:
        shutil.copyfile(source / "arm" / name, target / "arm" / name)
