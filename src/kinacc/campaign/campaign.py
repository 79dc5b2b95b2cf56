"""A measuring campaign from Python: the functions behind ``kinacc campaign``."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from kinacc.assess.registry import RECOMMENDED
from kinacc.campaign import begin
from kinacc.campaign import folder as folders
from kinacc.campaign.instrument import BASE, INSTRUMENT, Frame, Instrument, covariance_of
from kinacc.campaign.plan import Limits, Plan, assessor_of
from kinacc.campaign.recording import NOTHING, Recorded, read_readings, record
from kinacc.campaign.state import LeaveOut, Reading, State, Strike
from kinacc.campaign.status import Bound, CampaignStatus, status
from kinacc.errors import InputError, Problem, input_error
from kinacc.geometry import invert, numbers
from kinacc.measurements.row_names import RowNames
from kinacc.measurements.rows import joint_columns

if TYPE_CHECKING:
    from kinacc import api


@dataclass(frozen=True)
class NextPose:
    """The pose to measure next.

    ``joints`` (k,): reported joints, rad (mm where a joint slides); ``directions`` (k,) of travel
    on arrival, None where they do not matter; ``expected_mm`` (3,): modelled position in ``frame``
    (``base`` or ``instrument``), that of the readings; ``times_read``: readings of it so far.
    """

    point: str
    joints: np.ndarray
    directions: np.ndarray | None
    expected_mm: np.ndarray
    frame: str
    times_read: int


class Campaign:
    """A measuring campaign in a folder.

    Parameters
    ----------
    folder : path
        Folder of a campaign that was started.

    Raises
    ------
    InputError
        Where there is no campaign, or its files are damaged.

    Examples
    --------
    >>> import kinacc
    >>> calibration = kinacc.load_calibration("results/tracker")  # doctest: +SKIP
    >>> candidates = np.deg2rad(np.loadtxt("new_poses.csv", delimiter=","))  # doctest: +SKIP
    >>> campaign = kinacc.Campaign.start("check", calibration, candidates, 0.03)  # doctest: +SKIP
    >>> pose = campaign.next_pose()  # doctest: +SKIP
    >>> campaign.add_reading([812.31, -40.02, 655.90])  # doctest: +SKIP
    >>> campaign.bounds()[0].upper_mm  # doctest: +SKIP
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self.opened = folders.open_(self.folder)

    def __repr__(self) -> str:
        readings, candidates = len(self.state.readings), len(self.plan.points)
        return f"<Campaign {str(self.folder)!r}, {candidates} candidates, {readings} readings>"

    @classmethod
    def start(
        cls, folder: Path | str, calibration: api.Calibration, candidates: ArrayLike,
        noise_mm: ArrayLike, budget: int = 200, *, point: str | None = None,
        frame: Frame = INSTRUMENT, tolerance_mm: float | None = None, seed: int = 0,
        assessor: str = RECOMMENDED, settings: Mapping[str, object] | None = None,
    ) -> Campaign:  # fmt: skip
        """Start a campaign in a folder.

        Parameters
        ----------
        folder : path
            New folder.
        calibration : kinacc.Calibration
            Calibrated robot whose largest error is bounded.
        candidates : (m, k) array
            Reported joints, rad (mm where a joint slides), chosen without regard to errors.
        noise_mm : float, (3,) or (3, 3) array
            Standard deviation of a reading per axis, mm, or covariance, mm^2.
        budget : int
            Readings in all.
        point : str, optional
            Target that is measured.
        frame : str
            Frame of the readings: ``instrument`` or ``base``.
        tolerance_mm : float, optional
            Largest error allowed.
        seed : int
            Seed of the order of the candidates.
        assessor : str
            Name of the assessor.
        settings : mapping, optional
            Settings of the assessor.

        Raises
        ------
        InputError
            For candidates the model does not cover, a wrong noise, or a folder in use.
        """
        arm = calibration.model
        joints = arm.robot.finite_joints(candidates, "candidates")
        if frame not in (BASE, INSTRUMENT):
            raise input_error("frame", repr(frame), f"{BASE}, {INSTRUMENT}")
        if tolerance_mm is not None:
            tolerance_mm = float(numbers("tolerance_mm", tolerance_mm, ()))
        text = ",".join(map(repr, numbers("noise_mm", noise_mm).ravel().tolist()))
        instrument = Instrument(INSTRUMENT, covariance_of(text, "noise_mm"), frame)
        labels = [str(number) for number in range(1, len(joints) + 1)]
        points = begin.points_of(arm, joints, labels, None, point)
        chosen = assessor_of(assessor, {"measurements": budget, **(settings or {})}, len(points))
        limits, source = Limits(tolerance_mm=tolerance_mm), "given as an array"
        plan = begin.plan_of(arm, points, chosen, [instrument], limits, point, source, seed)
        begin.start(folder, arm, plan)
        return cls(folder)

    @property
    def state(self) -> State:
        """Readings as the assessor has them."""
        return self.opened.state

    @property
    def plan(self) -> Plan:
        """The plan: candidates and their order, instruments, assessor, limits."""
        return self.opened.plan

    def next_pose(self) -> NextPose | None:
        """Return the pose to measure next; None where no further reading is wanted."""
        folders.require_method(self.opened)
        point, points = self.state.requested, self.plan.points
        if point is None:
            return None
        return NextPose(
            points.label[point],
            points.joints[point],
            None if points.directions is None else points.directions[point],
            self._expected_mm([point])[0],
            self.plan.instruments[0].frame,
            sum(item.reading.point == point for item in self.state.used),
        )

    def visit(self, every: bool = True) -> pd.DataFrame:
        """Return the poses to measure now, a row each, in order.

        ``every``: all that are measured whatever is read; else the next one alone. Columns pose,
        q1_deg (q1_mm where a joint slides) .., s1 .. (travel), expected_x_mm ...
        """
        folders.require_method(self.opened)
        points, requested = self.plan.points, self.state.requested
        rows = self.state.ahead() if every and requested is not None else []
        if requested is not None and requested not in rows:
            rows = [requested, *rows]
        joints = joint_columns(self.plan.slides, points.joints[rows])
        table = pd.DataFrame({"pose": [points.label[row] for row in rows], **joints})
        if points.directions is not None:
            for joint, directions in enumerate(points.directions[rows].T, start=1):
                table[f"s{joint}"] = directions
        table[[f"expected_{axis}_mm" for axis in "xyz"]] = self._expected_mm(rows)
        return table

    def add_reading(
        self,
        position_mm: ArrayLike,
        point: str | None = None,
        joints: ArrayLike | None = None,
        instrument: str | None = None,
        accept_implausible: bool = False,
        again: bool = False,
    ) -> Recorded:
        """Record a reading; when this returns, it is on disk.

        Parameters
        ----------
        position_mm : (3,) array
            Measured position in the frame of the instrument.
        point : str, optional
            Candidate that was measured, by default the next one.
        joints : (k,) array, optional
            Reported joints, rad (mm where a joint slides).
        instrument : str, optional
            Instrument, by default the first.
        accept_implausible, again : bool
            Take a reading of any size, or one that repeats an earlier one to the last digit.

        Raises
        ------
        InputError
            For a reading that is refused; nothing is written.
        """
        with self._writing() as opened:
            plan = opened.plan
            number = opened.state.requested if point is None else plan.points.number(point)
            if number is None:
                message = "no further reading is needed"
                message = message if point is None else f"{point!r} is unknown"
                raise InputError(Problem("point", message, fix="name a candidate"), NOTHING)
            values = numbers("position_mm", position_mm).reshape(-1)
            reported = None if joints is None else np.asarray(joints, dtype=float).reshape(-1)
            reading = Reading(number, values, plan.instrument(instrument).name, reported)
            return record(opened, {"the reading": reading}, [], None, accept_implausible, again)

    def add_readings(
        self,
        path: Path | str,
        instrument: str | None = None,
        accept_implausible: bool = False,
        again: bool = False,
    ) -> Recorded:
        """Record the rows of a file that are new, all or none of them; see ``add_reading``.

        A row that equals a recorded reading to the last digit is known. Raises InputError where a
        row is wrong, where none is new, and where readings of the same file have no row any more.
        """
        with self._writing() as opened:
            rows, problems = read_readings(path, opened.plan, instrument)
            place = os.path.relpath(Path(path).resolve(), self.folder.resolve())
            return record(opened, rows, problems, place, accept_implausible, again)

    def leave_out(self, point: str, reason: str) -> None:
        """Leave a point without readings out, for a reason that is not its error."""
        with self._writing() as opened:
            state, number = opened.state, opened.plan.points.number(point)
            where = f"point {point}"
            if number is None:
                raise input_error(where, "is no candidate")
            if read := sum(item.reading.point == number for item in state.readings):
                message = f"has {read} readings: without it a large error could be hidden"
                raise input_error(where, message)
            if number in state.left_out:
                raise input_error(where, "was left out before")
            if len(state.rows) <= 2:
                raise input_error(where, "is one of the last 2 candidates")
            opened.write(LeaveOut(point=number, reason=_stated(reason)))

    def strike(self, number: int, reason: str) -> None:
        """Declare a reading void, for a reason that is not its size."""
        with self._writing() as opened:
            known = [item.number for item in opened.state.readings]
            if number not in known:
                allowed = RowNames(word="reading").spans(known)
                raise input_error(f"reading {number}", "is not there, or was struck", allowed)
            opened.write(Strike(reading=number, reason=_stated(reason)))

    @contextmanager
    def _writing(self) -> Iterator[folders.Opened]:
        with folders.writing(self.folder) as opened:
            yield opened
        self.opened = folders.open_(self.folder)

    def bounds(self, tolerance_mm: float | None = None) -> tuple[Bound, ...]:
        """Return the bounds on the largest error, the main one first."""
        return self.status(tolerance_mm).bounds

    def status(self, tolerance_mm: float | None = None) -> CampaignStatus:
        """Return bounds, verdict, assumptions and remarks; ``tolerance_mm`` in place of its own."""
        return status(self.opened, tolerance_mm)

    def _expected_mm(self, points: list[int]) -> np.ndarray:
        """Modelled positions (n, 3) in the frame of the readings, which is one for all."""
        modelled = self.plan.points.modelled_mm[points]
        if self.plan.instruments[0].frame != INSTRUMENT:
            return modelled
        back = invert(self.plan.to_base)
        return modelled @ back.rotation.T + back.position_mm


def _stated(reason: str) -> str:
    if not reason.strip():
        raise input_error("--reason", "is empty")
    return reason.strip()
