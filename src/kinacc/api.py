"""The public face: what a notebook imports as ``kinacc``, and what the commands call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from kinacc import __version__
from kinacc.calibration import stages
from kinacc.calibration.summary import reported_joints
from kinacc.checks import check, configuration
from kinacc.checks.described import describe_files
from kinacc.config import schema
from kinacc.config.error_models import PLAINEST, asked_for
from kinacc.config.records import Settings
from kinacc.config.schema import defaults
from kinacc.config.values import overlay
from kinacc.deployment import compare as comparing
from kinacc.deployment import compensate as compensating
from kinacc.deployment import folder as results
from kinacc.deployment import predict as predicting
from kinacc.deployment import programs, shared_readings
from kinacc.deployment import verify as verifying
from kinacc.deployment.export import files as exports
from kinacc.deployment.export import pendant as pendants
from kinacc.deployment.export import urdf
from kinacc.deployment.export.controllers import CONTROLLERS
from kinacc.deployment.export.source import Source
from kinacc.deployment.record import Calibration as CalibratedModel
from kinacc.errors import Problem, input_error, refuse, require_type
from kinacc.geometry import Pose, numbers
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import Robot
from kinacc.report import summarise
from kinacc.report.summary import CalibrationSummary
from kinacc.synthetic import source
from kinacc.tables import store, sums
from kinacc.tables.atomic import write_together
from kinacc.tables.columns import Columns, Tables
from kinacc.workflow.code import config_hash
from kinacc.workflow.data_sets import CALIBRATION, DataSets, data_sets, read_data_sets

Setup = Literal["same", "moved"]
_MARKS = {"kinacc_version": __version__, "config_hash": config_hash({}), "seed": "0"}


@dataclass(frozen=True)
class Measurements:
    """Measured poses of one robot.

    Attributes
    ----------
    name
        Name of the data set.
    robot
        The nominal robot.
    table
        One row a reading: pose, joints q1.. (rad; mm where a joint slides), position (mm, frame of
        the instrument), quaternion (scalar first, NaN for positions only), fold and subset.
    settings
        Settings of the data set, complete, as in the configuration file.
    """

    name: str
    robot: Robot
    table: pd.DataFrame
    settings: Settings

    def __len__(self) -> int:
        return len(self.table)

    def __repr__(self) -> str:
        poses = self.table["pose"].nunique()
        counts = f"{len(self)} readings, {poses} poses"
        return f"<Measurements {self.name!r} of {self.robot.name}, {counts}>"

    def check(self) -> pd.DataFrame:
        """Findings of the data check, the table ``data_check``.

        Raises
        ------
        InputError
            Listing the findings that would spoil a fit.
        """
        return pd.DataFrame(check.run({}, self.settings)["data_check"])


@dataclass(frozen=True)
class Calibration:
    """A calibrated robot: its tables and the model selected from them.

    Attributes
    ----------
    name
        Name of the data set.
    model
        The selected model with its frames and covariance.
    tables
        The tables of its results by name, as columns.
    config_hash
        Digest of the settings that the calibration was made with.
    """

    name: str
    model: CalibratedModel
    tables: Tables
    config_hash: str = ""

    def __repr__(self) -> str:
        rows = len(self.tables["measurements"]["pose"])
        return f"<Calibration {self.name!r} of {self.robot.name}, {self.selected}, {rows} readings>"

    @property
    def robot(self) -> Robot:
        """The nominal robot."""
        return self.model.robot

    @cached_property
    def summary(self) -> CalibrationSummary:
        """Held-out errors, selection, data check and what the poses leave open."""
        return summarise.summarise(self.name, self.tables, campaigns=())

    @property
    def selected(self) -> str:
        """Kind of the selected model: dh, vec, compliance or a registered one."""
        return self.model.choice

    @property
    def residuals(self) -> pd.DataFrame:
        """The table ``residuals``: mean, max, rms and gamma99 by comparison and subset."""
        return self.table("residuals")

    @property
    def parameters(self) -> pd.DataFrame:
        """Parameters of the selected model with their standard deviations (mm, rad)."""
        return self.table(f"{self.selected}_model")

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Parameters that no pose separates."""
        return self.summary.unidentifiable

    @property
    def poorly_determined(self) -> tuple[str, ...]:
        """Parameters that other poses would determine."""
        return self.summary.poorly_determined

    def table(self, name: str) -> pd.DataFrame:
        """A table of the results by name, such as ``residuals``; InputError for others."""
        if name not in self.tables:
            raise input_error(name, "no such table", ", ".join(self.tables))
        return pd.DataFrame(self.tables[name])

    def predict(
        self, q_rad: np.ndarray, s: np.ndarray | None = None, frame: str = "base",
        point: str | None = None,
    ) -> predicting.Prediction:  # fmt: skip
        """Poses at reported joints, each with its standard deviation.

        Parameters
        ----------
        q_rad
            (n, k) joints as the controller reports them, rad (mm where a joint slides).
        s
            (n, k) directions of travel, -1, 0 (unknown) or 1.
        frame
            ``base`` (of the robot) or ``instrument``.
        point
            A target by name or ``flange``; the tool where not given.

        Returns
        -------
        Prediction
            Poses (n, ...) in mm, standard deviations, residuals, joints outside the fitted range.

        Raises
        ------
        InputError
            For arrays of another shape, an unknown frame or point.
        """
        if s is not None:
            s = numbers("s", s, np.shape(np.atleast_2d(q_rad)))
        return predicting.predict(self.model, q_rad, s, frame, point)

    def compensate(
        self, poses: Pose, near_rad: np.ndarray | None = None, s: np.ndarray | None = None,
        frame: str = "base", point: str | None = None,
    ) -> compensating.Compensation:  # fmt: skip
        """Joints at which the calibrated robot reaches wanted poses.

        Parameters
        ----------
        poses
            (n, ...) wanted poses of ``point`` in ``frame``, positions in mm.
        near_rad
            (n, k) or (k,) reported joints; the posture nearest to them is taken.
        s, frame, point
            As in :meth:`predict`.

        Returns
        -------
        Compensation
            Joints (n, k) and a ``PoseStatus`` for each pose.

        Raises
        ------
        InputError
            For something else than poses, arrays of another shape, an unknown frame or point.
        """
        require_type("poses", poses, Pose)
        shape = len(poses.position_mm), self.robot.dh.joints
        near_rad = None if near_rad is None else numbers("near_rad", near_rad, shape)
        s = None if s is None else numbers("s", s, shape)
        return compensating.compensate(self.model, poses, near_rad, s, frame, point)

    def compensate_program(self, path: str | Path, **options: Any) -> programs.CorrectedProgram:
        """A robot program with coordinates that bring the calibrated robot to its positions.

        Parameters
        ----------
        path
            KUKA .src, ABB .mod, FANUC .ls, Universal Robots .script, Yaskawa .jbi, or .csv.
        options
            As in :func:`kinacc.deployment.programs.compensate_program`: ``tools``, ``bases``,
            ``near_rad``, ``at_most_mm`` and others.

        Returns
        -------
        CorrectedProgram
            ``table`` of corrections; ``write(path)`` writes the program.

        Raises
        ------
        InputError
            For a file that cannot be read, and frames that are missing.
        """
        if not Path(path).is_file():
            raise input_error(str(path), "no such file", "a robot program")
        return programs.compensate_program(self.model, path, **options)

    def save(self, folder: str | Path) -> Path:
        """Write all tables to a results folder that commands and :func:`load_calibration` read.

        ``kinacc verify FILE`` reads a later file as the data set's configuration states: save to
        ``results/NAME`` beside that (NAME is the data set). Elsewhere give the .yaml that ``kinacc
        init FILE`` writes.
        """
        folder = Path(folder)
        (folder / sums.FOLDER).mkdir(parents=True, exist_ok=True)
        marks = {**_MARKS, "config_hash": self.config_hash}
        contents = {
            f"{name}.parquet": store.content_of(store.to_table(name, columns, marks))
            for name, columns in self.tables.items()
        }
        written: dict[str | Path, bytes] = {
            folder / name: content for name, content in contents.items()
        }
        digests = folder / sums.FOLDER / "calibration.sha256"
        write_together(written | {digests: sums.text_of(contents, {})})
        return folder

    def export(self, folder: str | Path, formats: str | Sequence[str] = ()) -> list[Path]:
        """Write the selected model for other programs.

        Parameters
        ----------
        folder
            Folder of the files.
        formats
            Some of yaml, json, csv, urdf, markdown and latex; all that fit where not given.

        Returns
        -------
        list of Path
            The files written to ``folder``; files of the same names are replaced.
        """
        formats = [formats] if isinstance(formats, str) else formats
        files = exports.contents(Source(self.model, self.tables), formats)
        return [Path(path) for path in exports.write(files, folder, force=True)]

    def to_pinocchio(self) -> Any:
        """The calibrated DH model as ``pinocchio.Model`` (m, rad; frames ``flange``, ``tool``).

        Joints are those that the controller reports, or those of the DH table where these are
        coupled.
        """
        return urdf.to_pinocchio(self._dh_source())

    def to_pybotics(self, point: str | None = None) -> Any:
        """The calibrated DH model as ``pybotics.robot.Robot`` (mm, rad).

        Parameters
        ----------
        point
            A target by name or ``flange``; the tool where not given.

        Returns
        -------
        pybotics.robot.Robot
            Its joints are those of the DH table: ``calibration.robot.dh_joints(q_rad)``.
        """
        return urdf.to_pybotics(self._dh_source(), point)

    def _dh_source(self) -> Source:
        """The DH model, whatever model was selected."""
        return Source(results.calibration(self.tables, PLAINEST), self.tables)

    def values_for(self, controller: str, settings: Settings | None = None) -> pendants.Pendant:
        """Numbers to enter into a controller: kuka, abb, fanuc, ur, yaskawa, staubli, ros.

        Parameters
        ----------
        controller
            One of the names above.
        settings
            The section ``calibration`` of the data set; where not given the defaults, with base and
            tool fitted as they were.

        Returns
        -------
        Pendant
            Old and new values, and the mean errors at held-out poses.
        """
        if controller not in CONTROLLERS:
            raise input_error("controller", repr(controller), ", ".join(CONTROLLERS))
        fitted = "estimated" if self.summary.frames_fitted else "fixed"
        settings = settings or defaults()["calibration"] | {"base_and_tool": fitted}
        return pendants.fit_pendant(self.tables, settings, controller, self.name)


def read_measurements(
    *paths: str | Path,
    robot: str | Path | None = None,
    dataset: str | None = None,
    settings: Settings | None = None,
    **answers: Any,
) -> Measurements:
    """Read measured files, or the measurements that a data set describes.

    Parameters
    ----------
    paths
        A file with joints and measured points (CSV, text, Excel, Parquet), or two files, one of
        each, with 6 poses or more, as base and tool are fitted to check them; or a configuration
        file (.yaml), as ``kinacc init`` writes it, which reads any number of poses.
    robot
        Of measured files: a shipped name, a robot file or a URDF file. [the shipped robot that
        fits]
    dataset
        Data set of a configuration file; not needed where it describes one.
    settings
        Values in place of those of the file, nested as there, such as
        ``{"calibration": {"vec": {"order": 5}}}``.
    answers
        What measured files leave open, by the option of ``kinacc init``: ``joint_unit="rad"``,
        ``orientation="ZYX"``, ``take=["X", "q1"]``, ``join="order"``.

    Raises
    ------
    InputError
        Listing what is wrong with settings or measurements, with file, line and column; or the
        questions that measured files leave open, with their answers.
    """
    if not paths:
        raise input_error("paths", "are not given", "a measured file or FILE.yaml")
    for path in paths:
        require_type("path", path, str, Path)
    if all(Path(path).suffix in (".yaml", ".yml") for path in paths):
        described = read_data_sets(paths).settings
        if settings:
            overrides = {"datasets": dict.fromkeys(described, settings)}
            described = read_data_sets(paths, overrides).settings
        refuse(Problem(key, "only measured files take it", fix="use settings") for key in answers)
    else:
        files = describe_files(paths, None if robot is None else str(robot), answers)
        content = {name: overlay(item, settings or {}) for name, item in files.items()}
        described = data_sets(configuration.load([], {"datasets": content})).settings
    if dataset is None and len(described) > 1:
        where = ", ".join(map(str, paths))
        raise input_error(where, "describes several data sets", ", ".join(described))
    name = dataset or next(iter(described))
    if name not in described:
        raise input_error("dataset", f"no data set {name!r}", ", ".join(described))
    settings = described[name]
    table = pd.DataFrame(_as_written(source.run({}, settings))["measurements"])
    return Measurements(name, robots.load(settings["robot"]), table, settings)


def calibrate(measurements: Measurements | str | Path) -> Calibration:
    """Fit and compare the models of a data set, as ``kinacc calibrate`` does.

    Parameters
    ----------
    measurements
        Measured poses, or a path that :func:`read_measurements` reads. Rows that were taken out of
        ``table`` are not fitted.

    Returns
    -------
    Calibration
        The selected model, and all tables of its results.

    Raises
    ------
    InputError
        For a file that cannot be read, or listing findings of the data check that would spoil a
        fit.
    FitError
        Where the data do not determine a fit.
    """
    if isinstance(measurements, (str, Path)):
        measurements = read_measurements(measurements)
    require_type("measurements", measurements, Measurements)
    settings = measurements.settings
    tables = _as_written(source.run({}, settings))
    tables["measurements"] = {
        name: measurements.table[name].to_numpy() for name in tables["measurements"]
    }
    if settings["measurements"]["source"] == "file":
        tables |= _as_written(check.run({}, settings))
    kinds = [kind for kind in asked_for(settings["calibration"]) if kind != PLAINEST]
    for kind in (*kinds, PLAINEST):
        tables |= _as_written(stages.fit_model(tables, settings, kind))
    for stage in (stages.compare_models, summarise.run):
        tables |= _as_written(stage(tables, settings))
    data = DataSets({measurements.name: settings}, 1, ())
    made_by = config_hash(data.chosen(measurements.name, *CALIBRATION))
    return _of_tables(measurements.name, tables, None, made_by)


def load_calibration(folder: str | Path, model: str | None = None) -> Calibration:
    """Read the calibration in a results folder.

    Parameters
    ----------
    folder
        Results folder of a data set, such as ``results/tracker``.
    model
        Kind of the model; the selected one where not given.

    Raises
    ------
    InputError
        Naming the tables that are missing or damaged.
    """
    require_type("folder", folder, str, Path)
    folder = Path(folder)
    optional = (*summarise.PAGE_TABLES, *summarise.ON_PAGE)
    tables = results.read_tables(folder, *optional, needed=(*results.NEEDED, "summary"))
    made_by = store.read_metadata(folder / "summary.parquet").get("config_hash", "")
    return _of_tables(folder.resolve().name, tables, model, made_by)


def verify(
    calibration: Calibration, readings: Measurements, base: Setup, tool: Setup
) -> verifying.Verification:
    """Test whether a calibration still holds at readings that it was not fitted to.

    Parameters
    ----------
    calibration
        The calibration.
    readings
        New readings, 10 to 20 configurations. A file like that of the calibration:
        ``read_measurements("tracker.yaml", settings={"measurements": {"file": {"path": FILE}}})``.
    base, tool
        Whether instrument and target stand as they did (``same``) or were set up anew
        (``moved``): what moved is fitted to the readings.

    Returns
    -------
    Verification
        ``verdict`` (pass, fail or undecided) with its reason, and errors (mm, mrad).

    Raises
    ------
    InputError
        For readings of another robot, or other values of ``base`` and ``tool``.
    """
    require_type("calibration", calibration, Calibration)
    require_type("readings", readings, Measurements)
    setups = {verifying.BASE: base, verifying.TOOL: tool}
    refuse(
        Problem(name, repr(setup), "same, moved")
        for name, setup in setups.items()
        if setup not in ("same", "moved")
    )
    moved = [name for name, setup in setups.items() if setup == "moved"]
    weight = float(readings.settings["calibration"]["rotation_weight_mm_per_rad"])
    columns = {name: readings.table[name].to_numpy() for name in readings.table}
    return verifying.verify(calibration.tables, columns, moved, weight)


def compare(
    first: Calibration, second: Calibration, q_rad: np.ndarray | None = None
) -> comparing.Difference:
    """What moved from a calibration to another one of the same robot.

    Parameters
    ----------
    first, second
        Two calibrations. VEC models have no test; the command compares DH models, as
        ``load_calibration(folder, "dh")`` reads them.
    q_rad
        (n, k) reported joints, rad (mm where a joint slides), at which poses are compared; all
        measured ones where not given.

    Returns
    -------
    Difference
        ``shifts``, ``poses`` and ``parameters`` as DataFrames, and the readings both share.

    Raises
    ------
    InputError
        For calibrations of different robots, or joints of another shape.
    """
    require_type("first", first, Calibration)
    require_type("second", second, Calibration)
    measured = [fit.tables["measurements"] for fit in (first, second)]
    if q_rad is None:
        q_rad = np.concatenate(
            [reported_joints(table, first.robot.dh.joints) for table in measured]
        )
    q_rad = first.robot.finite_joints(q_rad, "q_rad")
    readings = shared_readings.shared(*measured)
    weight = schema.key("calibration.rotation_weight_mm_per_rad")["default"]
    return comparing.compare(first.model, second.model, q_rad, weight, readings)


def _of_tables(name: str, tables: Tables, kind: str | None, made_by: str) -> Calibration:
    model = results.calibration(tables, kind, name)
    return Calibration(name, model, tables, made_by)


def _as_written(tables: Tables) -> dict[str, Columns]:
    """Tables held to their schemas, with its columns in its order."""
    return {
        name: store.columns_in(store.to_table(name, columns, _MARKS))
        for name, columns in tables.items()
    }
