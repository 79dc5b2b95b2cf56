"""Settings: a model for each section; a key has its default, unit, range and one line of text.

To add a key, add a line here and one to config.yaml. Validation, defaults, data sets that give it
anew, hashes, JSON Schema and the reference page follow. Names carry the unit (_mm, _deg); ranges
are what is plausible in it, so that a value in another unit is caught. Defaults are the paper's.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, model_validator

from kinacc.config.fields import (
    Distinct,
    OrWord,
    Pair,
    Rising,
    Section,
    Text,
    is_there,
    refused,
    setting,
)
from kinacc.config.gate_rules import Gates, require_limits
from kinacc.config.measured import Measurements
from kinacc.config.names import LONGEST
from kinacc.config.parameter_rules import FrameRules, JointRules
from kinacc.config.series import Series
from kinacc.config.values import did_you_mean

ROBOTS = Path(__file__).parents[1] / "kinematics" / "robots"
SHIPPED = sorted(item.stem for item in ROBOTS.glob("*.yaml"))

JointNumbers = Annotated[list[Annotated[int, Field(ge=1, le=7)]], Field(max_length=7), Distinct]
JointPairs = Annotated[list[Pair], Field(min_length=4, max_length=7)]


_THREE = Field(min_length=3, max_length=3)
Vector = Annotated[list[Annotated[float, Field(ge=-10000, le=10000)]], _THREE]
Angles = Annotated[list[Annotated[float, Field(ge=-360, le=360)]], _THREE]
_RULES = "to free, fixed or {value_mm: .., prior_std_mm: ..}, with mm, mrad, rad or deg"
_FINDINGS = Path(__file__).parents[1] / "checks" / "findings.yaml"
_KINDS = {*re.findall(r"^\w+", _FINDINGS.read_text("utf-8"), re.MULTILINE)}
OUTSIDE_LIMITS = "outside_limits"  # the finding of rows that no fit reads, accepted or not
Finding = Literal[*sorted(_KINDS - {OUTSIDE_LIMITS})]  # type: ignore[valid-type]


class Link(Section):
    """What a link weighs."""

    mass_kg: float = setting(..., "mass of the link", "kg", ge=0, le=10000)
    centre_mm: Vector = setting(..., "its centre in the DH frame its joint carries", "mm")


class DataCheck(Section):
    """What the check of a measured file found and the workflow goes on with."""

    accept: dict[Finding, Text] = setting(  # type: ignore[valid-type]
        {},
        "findings that would stop the workflow, each with the reason to go on",
    )


class VecFit(Section):
    """Volumetric error compensation model (eqs. 5 and 6)."""

    order: OrWord[Annotated[int, Field(ge=0, le=40)], Literal["auto"]] = setting(
        5,
        "order of the Chebyshev polynomials, or auto: chosen by evidence",
    )
    order_highest: int = setting(40, "highest order tried where order is auto", ge=1, le=40)
    prior: Literal["stated", "chosen"] = setting(
        "stated",
        "the prior stated below, or one chosen by evidence, with the order",
    )
    joint_range: OrWord[JointPairs, Literal["data", "limits"]] = setting(
        "data",
        "joint range mapped to -1..1: of the data, the joint limits, or one pair per joint",
        "deg",
    )
    joint_range_margin_deg: float = setting(
        1.0,
        "widening of the data's range at both ends",
        "deg",
        ge=0,
        le=90,
    )
    travel_direction: bool = setting(False, "fit eps_z offsets per travel direction (backlash)")
    prior_std_mm: float = setting(
        1.0,
        "standard deviation of the prior on length coefficients",
        "mm",
        ge=0.0001,
        le=1000,
    )
    prior_std_mrad: float = setting(
        1.0,
        "standard deviation of the prior on angle coefficients",
        "mrad",
        ge=0.0001,
        le=1000,
    )
    prior_decay: float = setting(
        1.0,
        "factor on both from each order above the first to the next; 1 for none",
        ge=0.01,
        le=1,
    )


class DhFit(Section):
    """Denavit-Hartenberg model (eqs. 3 and 4)."""

    fit_to: Literal["vec", "measurements"] = setting(
        "vec",
        "fit to the VEC at the measured configurations, or to the measurements",
    )
    hayati_joints: OrWord[JointNumbers, Literal["auto"]] = setting(
        [],
        "joints with a Hayati twist beta beside d, or auto: beta in place of d where the next "
        "axis is nearly parallel",
    )
    parameters: JointRules = setting(
        {},
        "parameters that are free, fixed or known beforehand; the others are free, beta where "
        "hayati_joints says so",
        allowed=f"a mapping of names (d, joint 3, joint 3 d) {_RULES}",
    )
    loss: Literal["squares", "huber", "tukey"] = setting(
        "squares",
        "what residuals cost; huber and tukey lean less on rows far off",
    )
    truncation: float = setting(
        0.01,
        "singular values below this share of the largest are left out",
        gt=0,
        lt=1,
    )


class Payload(Section):
    """What the last DH frame carries in rows whose file has no payload columns."""

    mass_kg: float = setting(0.0, "mass", "kg", ge=0, le=10000)
    centre_mm: Vector = setting(
        [0.0, 0.0, 0.0],
        "centre of gravity in the last DH frame",
        "mm",
    )


class ComplianceFit(Section):
    """Joints that bend under gravity, fitted with the DH parameters to the measurements."""

    joints: JointNumbers = setting([], "joints that bend; none: no such model")
    gravity: Vector = setting(
        [0.0, 0.0, -1.0],
        "direction of gravity in the first DH frame, of any length above 0",
    )
    links: list[Link] = setting(
        [],
        "mass of each link and its centre in the DH frame that the joint of its number carries;"
        " none: unknown, so that only the product of weight and compliance can be seen",
    )
    payload: Payload = Payload()


class Calibration(Section):
    """How the VEC and DH models are fitted."""

    rotation_weight_mm_per_rad: float = setting(
        500.0,
        "position error that weighs as much as one radian of rotation",
        "mm/rad",
        ge=1,
        le=10000,
    )
    base_and_tool: Literal["fixed", "estimated"] = setting(
        "fixed",
        "base and tool frames: the robot file's own, or estimated with the model",
    )
    frames: FrameRules = setting(
        {},
        "components of base and tool that are fixed or known beforehand, where the others are "
        "estimated",
        allowed=f"a mapping of names (base, base rz, tool x) {_RULES}",
    )
    vec: VecFit = VecFit()
    dh: DhFit = DhFit()
    compliance: ComplianceFit = ComplianceFit()

    @model_validator(mode="after")
    def _frames_are_estimated(self) -> Self:
        if self.frames and self.base_and_tool == "fixed":
            message = f"{', '.join(self.frames)}, but base and tool are not estimated"
            raise refused(message, "set calibration.base_and_tool: estimated", "frames")
        return self


class Cylinder(Section):
    """Sector of a cylinder about the robot's first axis, robot base frame."""

    inner_radius_mm: float = setting(
        1200.0, "radius at which the space begins", "mm", ge=0, le=5000
    )
    radial_span_mm: float = setting(900.0, "radial extent", "mm", ge=10, le=5000)
    bottom_mm: float = setting(0.0, "height at which the space begins", "mm", ge=-5000, le=5000)
    height_mm: float = setting(500.0, "vertical extent", "mm", ge=10, le=5000)
    angle_deg: Pair = setting([0.0, 60.0], "angles about the first axis", "deg")


class Evaluation(Section):
    """The evaluation space and the points assessed in it."""

    space: Literal["cylinder", "measured"] = setting(
        "cylinder",
        "sector of a cylinder, or the measured configurations",
    )
    cylinder: Cylinder = Cylinder()
    reference_orientation_deg: Angles = setting(
        [180.0, -90.0, -30.0],
        "flange orientation before the rotations, intrinsic XYZ angles in the reference frame",
        "deg",
    )
    reference_frame: Literal["slice", "base"] = setting(
        "base",
        "frame that keeps this orientation: of the radial slice, with which it turns, or of the"
        " robot's base, as a workpiece on a table",
    )
    rotation_deg: float = setting(
        45.0,
        "rotations about the flange's axes, both signs",
        "deg",
        ge=0,
        le=180,
    )
    rotations: Literal["signs_and_zero", "all_27"] = setting(
        "all_27",
        "the eight sign combinations and zero, or all 27 of minus, zero, plus",
    )
    tool_mm: Vector = setting(
        [0.0, 0.0, 0.0],
        "tool centre point in the flange frame (synthetic arm)",
        "mm",
    )
    sequence: Literal["sobol", "halton"] = setting("sobol", "quasi-random sequence of the points")
    points: int = setting(200, "number of operating points assessed", ge=1, le=100000)
    points_in: Literal["space", "joints"] = setting(
        "space",
        "draw positions, orientations and branch in the space, or joints directly",
    )
    wrist: Literal["both", "noflip", "flip"] = setting(
        "both",
        "wrist configurations of the points drawn in the space; the map has both",
    )
    invert_with: Literal["dh", "vec", "nominal"] = setting(
        "dh",
        "model the poses are inverted with, as the controller would",
    )
    travel_direction: int = setting(
        0,
        "travel direction of all joints at the points: -1, +1, or 0 for unknown",
        ge=-1,
        le=1,
    )


class AccuracyMap(Section):
    """Accuracy maps (Fig. 3)."""

    slices_deg: Annotated[list[Annotated[float, Field(ge=-360, le=360)]], Rising] = setting(
        [0.0, 15.0, 30.0, 45.0, 60.0],
        "angles of the radial slices",
        "deg",
        min_length=1,
        max_length=100,
    )
    grid_mm: float = setting(25.0, "spacing of the grid in radius and height", "mm", ge=1, le=500)


class Study(Section):
    """Monte Carlo study of the assessors (Fig. 4)."""

    noise_mm: Annotated[list[Annotated[float, Field(ge=0.001, le=5)]], Rising] = setting(
        [0.05, 0.1, 0.15, 0.2, 0.25, 0.3],
        "standard deviations of the noise per axis",
        "mm",
        min_length=1,
        max_length=100,
    )
    repetitions: int = setting(100, "simulations per noise", ge=1, le=100000)
    measurements: int = setting(
        200,
        "measurements every method may spend in a simulation",
        ge=1,
        le=100000,
    )
    alpha: float = setting(0.6, "threshold on the rejection probability (eq. 22)", gt=0, lt=1)
    outlier_rule: Literal["normal", "gamma", "iqr"] = setting(
        "normal",
        "cut c of eq. 14: mean + 1.96 std, 99 % gamma quantile, or Tukey fence",
    )
    distance: Literal["squared", "as_printed"] = setting(
        "squared",
        "eq. 18 integrates to the squared distance, or to its root as printed",
    )
    covariance: Literal["r", "sqrt_r"] = setting(
        "r", "eq. 24 divides by r, or by its root as printed"
    )
    search: Literal["from_above", "from_below", "bisection"] = setting(
        "from_above",
        "which bound is the smallest that did not reject",
    )
    visiting_order: Literal["sequence", "shuffled"] = setting(
        "sequence",
        "points visited as drawn, or shuffled per simulation",
    )
    chunks: int = setting(
        2,
        "parts the study is computed in; no influence on results",
        ge=1,
        le=1000,
        execution=True,
    )


class Histories(Section):
    """Two simulations of model invalidation in full (Figs. 5 and 6)."""

    noise_mm: float = setting(0.3, "standard deviation of the noise per axis", "mm", ge=0.001, le=5)
    eta_ratio_rejected: float = setting(
        0.9205298,
        "bound over true accuracy of the history that rejects (0.834/0.906)",
        ge=0.01,
        le=10,
    )
    eta_ratio_larger: float = setting(
        0.9315673,
        "slightly larger bound tried on the same world (0.844/0.906)",
        ge=0.01,
        le=10,
    )
    eta_ratio_kept: float = setting(
        1.1291391,
        "bound over true accuracy of the history that cannot reject (1.023/0.906)",
        ge=0.01,
        le=10,
    )
    simulations_searched: int = setting(
        1000,
        "simulations looked through for one that fits the figures' rule",
        ge=1,
        le=1000000,
    )

    @model_validator(mode="after")
    def _larger(self) -> Self:
        if self.eta_ratio_larger <= self.eta_ratio_rejected:
            message = f"{self.eta_ratio_larger:g} is not larger than eta_ratio_rejected"
            raise refused(message, "", "eta_ratio_larger")
        return self


class Figures(Section):
    """Pictures."""

    formats: Annotated[list[Literal["svg", "png", "pdf"]], Field(min_length=1), Distinct] = setting(
        ["svg", "png", "pdf"],
        "file formats",
    )


class Robustness(Section):
    """The claims on further accepted draws of the synthetic arm."""

    draws: int = setting(20, "number of further draws", ge=1, le=1000)


class Tolerance(Section):
    """How far the calibrated arm may be off: for gates, campaigns, summary and report."""

    mm: float | None = setting(
        None,
        "largest position error allowed; null where none is set",
        "mm",
        gt=0,
        lt=1000,
    )
    of: Literal["mean", "quantile_99", "bound"] = setting(
        "bound",
        "what has to be within it: mean or empirical 99 % quantile of the errors held out, or a"
        " campaign's upper bound",
    )


class Settings(Section):
    """Everything a data set can set beside its robot; the top level of the configuration."""

    seed: int = setting(20240, "seed of every random number", ge=0, le=9007199254740992)
    measurements: Measurements = Measurements()
    data_check: DataCheck = DataCheck()
    calibration: Calibration = Calibration()
    evaluation: Evaluation = Evaluation()
    map: AccuracyMap = AccuracyMap()
    study: Study = Study()
    histories: Histories = Histories()
    figures: Figures = Figures()
    robustness: Robustness = Robustness()
    tolerance: Tolerance = Tolerance()
    gates: Gates = setting(
        [],
        "what `kinacc check-results` holds results to (docs/pipeline.md)",
        execution=True,
    )

    @model_validator(mode="after")
    def _together(self) -> Self:
        """Settings of different sections that cannot be together."""
        cylinder = self.evaluation.cylinder
        low, high = cylinder.angle_deg
        outside = [item for item in self.map.slices_deg if not low <= item <= high]
        if self.evaluation.space == "cylinder" and outside:
            message = f"slices at {outside} deg lie outside of {low:g} to {high:g} deg"
            raise refused(message, "see evaluation.cylinder.angle_deg", "map", "slices_deg")
        require_limits(self.gates, self.tolerance.mm, self.tolerance.of)
        return self


def _robot(robot: str, info: ValidationInfo) -> str:
    if robot not in SHIPPED and not is_there(robot, info):
        fix = "give a name listed in docs/robots.md or the path of a robot file"
        raise refused(f"there is no robot {robot!r}", did_you_mean(robot, SHIPPED) or fix)
    return robot


class DataSet(Settings):
    """A data set: its robot, and any section anew."""

    robot: Annotated[Text, AfterValidator(_robot)] = setting(
        ..., "name of a shipped robot, or path of a robot file"
    )
    series: Series = setting([], "measured files of one arm, a calibration each")

    @model_validator(mode="after")
    def _of_one_kind(self) -> Self:
        source, file = self.measurements.source, self.measurements.file
        of_source = ("measurements", "source")
        if self.series and source == "synthetic":
            raise refused("synthetic, but a series is of measured files", "write file", *of_source)
        if source == "synthetic" and self.robot in SHIPPED and self.robot != "mh180":
            fix = "robot: mh180, or a measured file"
            raise refused(f"synthetic, but there is no synthetic {self.robot}", fix, *of_source)
        if source == "synthetic" and self.calibration.base_and_tool == "estimated":
            message = "estimated, but the synthetic arm is measured in its own base frame"
            raise refused(message, "write fixed", "calibration", "base_and_tool")
        if source == "file" and file.path is None and not self.series:
            fix = "path of a CSV, text, Excel or Parquet file"
            raise refused("file, but measurements.file.path is not given", fix, *of_source)
        other = file.path not in (None, *(line.path for line in self.series))
        if self.series and (other or file.exclude or file.joints.path):
            message = "path, exclude or joints.path of another file, beside a series of files"
            raise refused(message, "write the file as a line of the series", "measurements", "file")
        return self


class Configuration(Settings):
    """A whole configuration: data sets by name, and what holds for all of them."""

    # A name becomes a folder below results/, so that it may not lead anywhere else.
    datasets: dict[
        Annotated[str, Field(pattern="^[A-Za-z0-9_][A-Za-z0-9_-]*$", max_length=LONGEST)], DataSet
    ] = setting({}, "data sets by name", allowed="{name of letters, digits, _ and -: settings}")
