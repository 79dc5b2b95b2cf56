"""What every format of ``kinacc export`` is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from kinacc.calibration import identifiability
from kinacc.config.error_models import PLAINEST, model_name
from kinacc.deployment import folder as results
from kinacc.deployment.record import STATED, Calibration
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.tables import store
from kinacc.tables.columns import Tables
from kinacc.tables.contract import PROVENANCE_KEYS

CONVENTION = "T = Rz(q + theta_offset) Tz(d) Tx(a) Rx(alpha) Ry(beta) per joint"


@dataclass(frozen=True)
class Source:
    """A calibrated model, the ``tables`` of its results and what was asked for.

    ``provenance``: version, settings and seed that the model was made with.
    ``urdf_file``: a URDF whose origins are to be corrected, from link ``links[0]`` to ``links[1]``.
    """

    calibration: Calibration
    tables: Tables
    provenance: Mapping[str, str] = field(default_factory=dict)
    urdf_file: Path | str | None = None
    links: tuple[str | None, str | None] = (None, None)

    @property
    def name(self) -> str:
        """Name of the calibrated arm."""
        robot, name = self.calibration.robot.name, self.calibration.name
        return f"{name if name.startswith(robot) else f'{robot}_{name}'}_calibrated"

    @property
    def about(self) -> str:
        """Where the arm comes from."""
        arm = self.calibration
        return f"calibrated from {arm.robot.name} with data set {arm.name}"

    @property
    def dh(self) -> DHModel:
        """The DH table of the model."""
        return self.calibration.model.dh

    @property
    def joints(self) -> pd.DataFrame:
        """A row a joint of the DH table: joint, type, and value, nominal value and std of
        parameters.

        NaN where there is no standard deviation.
        """
        dh, joint = self.dh, np.arange(1, self.dh.joints + 1)
        table = {"joint": joint, "type": np.where(dh.prismatic, "prismatic", "revolute")}
        for name in PARAMETERS:
            table[name] = getattr(dh, name)
            table[f"nominal_{name}"] = getattr(self.calibration.robot.dh, name)
        # Columns that a table lacks, as that of no fit or of a registered model, are NaN.
        fitted = pd.DataFrame(
            dict(self.tables.get(f"{self.calibration.choice}_model", {})),
            columns=["joint", *(f"std_{name}" for name in PARAMETERS)],
        )
        fitted = fitted.drop_duplicates("joint").set_index("joint").reindex(joint).astype(float)
        return pd.DataFrame(table).join(fitted.reset_index(drop=True))

    @property
    def coupled_lines(self) -> list[str]:
        """Which joints a URDF has, where they are not the reported ones; else nothing."""
        joint_map = self.calibration.robot.joint_map
        if np.array_equal(joint_map, np.diag(np.sign(np.diag(joint_map)))):
            return []
        return [
            "Joints of the URDF are those of the DH table: reported ones are coupled or scaled."
        ]

    @property
    def orientation_lines(self) -> list[str]:
        """Targets whose orientation no reading has, for a comment; nothing where there are none."""
        arm = self.calibration
        names = [item for item in arm.targets if arm.orientation_source(item) == STATED]
        sentence = "Orientation as stated in the robot file, not measured"
        return [f"{sentence}: {', '.join(names)}."] if names else []

    @property
    def left_open_lines(self) -> list[str]:
        """What the poses leave open, under a heading; nothing where they do not."""
        reported = self.calibration.left_open
        return ["Left open by the poses:", *(f"  {text}" for text in reported)] if reported else []


def read_source(
    folder: Path | str,
    model: str = PLAINEST,
    urdf_file: Path | str | None = None,
    links: tuple[str | None, str | None] = (None, None),
) -> Source:
    """What formats are made of, from a results folder; InputError where it cannot be used."""
    tables = results.read_tables(folder)
    arm = results.calibration(tables, model, Path(folder).resolve().name)
    path = Path(folder) / f"{model}_model.parquet"
    known = store.read_metadata(path) if path.is_file() else {}
    marks = {key: known[key] for key in PROVENANCE_KEYS if key in known}
    return Source(arm, tables, marks, urdf_file, links)


def notes(source: Source) -> list[str]:
    """What the poses leave open, and the model that was selected instead of the one written."""
    lines, identified = [], source.tables.get(f"{PLAINEST}_identified")
    weak = identifiability.weak(identifiability.listed(identified)) if identified else []
    if weak:
        lines = [f"warning: valid for poses like the measured ones: {'; '.join(weak)}"]
    selected = results.selected_model(source.tables)
    if selected != source.calibration.choice:
        lines.append(f"note: {model_name(selected)} was selected (--model {selected})")
    return [*lines, *source.coupled_lines]
