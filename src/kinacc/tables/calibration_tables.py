"""Contract of the tables from measured poses to residuals."""

from __future__ import annotations

from kinacc.tables.allowed import (
    COMPARISONS,
    ERRORS,
    ESTIMATES,
    IDENTIFIER_PATTERN,
    MODELS,
    QUANTITIES,
    SUBSETS,
    UNITS_OF_RESIDUALS,
)
from kinacc.tables.columns import (
    BY_POSES,
    BY_ROW,
    ERROR_MRAD,
    JOINTS,
    JOINTS_MAX,
    REACH_MM,
    ROW_NAME,
    SLIDES,
    TRAVEL_MM,
    TURN_RAD,
    Artefact,
    Column,
    absent_if_unstated,
    error_vector,
    length,
    magnitude,
    real,
    same,
    text,
    unstated,
    whole,
)
from kinacc.tables.covariance_tables import DH_COVARIANCE, DH_IDENTIFIED, VEC_COVARIANCE


def _position(of: str, nullable: bool = False) -> tuple[Column, ...]:
    return tuple(
        length(f"{axis}_mm", f"{axis} coordinate of {of}", REACH_MM, nullable) for axis in "xyz"
    )


def _quaternion(of: str, nullable: bool = False) -> tuple[Column, ...]:
    return tuple(
        real(f"q{part}", "1", f"{part} of the unit quaternion of {of}, w >= 0", -1, 1, nullable)
        for part in "wxyz"
    )


_DH_PARAMETERS = (
    ("theta_offset_rad", "rad", "joint angle offset theta", TURN_RAD),
    ("d_mm", "mm", "offset d along the joint axis", 2.0e4),
    ("a_mm", "mm", "length a along the common normal", 2.0e4),
    ("alpha_rad", "rad", "twist alpha about the common normal", TURN_RAD),
    ("beta_rad", "rad", "Hayati twist beta about y, 0 where the joint has none", TURN_RAD),
)
_DH = tuple(
    real(name, unit, f"{meaning} (nominal)", -limit, limit)
    for name, unit, meaning, limit in _DH_PARAMETERS
)
_DH_FITTED = tuple(
    each
    for name, unit, meaning, limit in _DH_PARAMETERS
    for each in same(BY_POSES, real(name, unit, meaning, -limit, limit))
)
_DH_STD = tuple(
    magnitude(f"std_{name}", unit, f"standard deviation of {name}, null if undetermined", 1e4, True)
    for name, unit, _, _ in _DH_PARAMETERS
)
_FRAME_COLUMNS = (
    text("model", "model the frame belongs to", MODELS),
    text(
        "frame",
        "base (robot base in the instrument's frame), tool (tool centre point in the flange frame) "
        "or the name of a target (in the flange frame)",
    ),
    *unstated((text("session", "session a base belongs to; null for one alone and for targets"),)),
    *same(BY_POSES, *_position("the frame's origin"), *_quaternion("the frame's orientation")),
)
_FIT_COLUMNS = (
    text("quantity", "what the row states, e.g. rank, singular_value", pattern=IDENTIFIER_PATTERN),
    whole(
        "number",
        "running number within the quantity, from 1; null for a single value",
        1,
        None,
        True,
    ),
    text("parameter", "parameter the row speaks of; null where none", nullable=True),
    real("value", "see unit", "the value", nullable=True),
    text("unit", "unit of the value; 1 for a pure number"),
)
_PAYLOAD = absent_if_unstated(
    real("payload_kg", "kg", "mass of what the last DH frame carries", 0.0, 1e4),
    *(
        real(f"payload_{axis}_mm", "mm", f"{axis} of its centre, last DH frame", -1e4, 1e4)
        for axis in "xyz"
    ),
)
_STATED_BY_FILES = (
    text("session", "session with a base frame of its own; null for one alone"),
    *(magnitude(f"std_{axis}_mm", "mm", f"standard deviation of {axis}_mm", 1e3) for axis in "xyz"),
    *(
        real(f"corr_{pair}", "1", f"correlation of {pair[0]}_mm and {pair[1]}_mm", -1, 1)
        for pair in ("xy", "xz", "yz")
    ),
    *(
        magnitude(
            f"std_r{axis}_rad",
            "rad",
            f"standard deviation of the target's small turn about the instrument's {axis}",
            TURN_RAD,
        )
        for axis in "xyz"
    ),
    real("temperature_c", "degC", "temperature stated with the reading", -273.15, 1e3),
    whole("row", "line of the measured file the reading stands in", 1),
)
MEASUREMENTS = Artefact(
    "measurements",
    "Measured poses, one row per reading of one target.",
    (
        whole("pose", "number of the joint configuration"),
        *JOINTS,
        text("target", "name of the measured target"),
        *_position("the target in the instrument's frame"),
        *_quaternion("the target in the instrument's frame, null for position only", True),
        whole("repeat", "number of the reading at this configuration and target"),
        text("subset", "train (used by the delivered fits) or validation (held out)", SUBSETS),
        whole("fold", "fold in which the row is held out; null without folds", nullable=True),
        *unstated(_STATED_BY_FILES),
        *_PAYLOAD,
        *ROW_NAME,
    ),
    ("pose", "target", "repeat"),
)
_BY_ERROR = "mm for delta, rad for eps"
VEC_MODEL = Artefact(
    "vec_model",
    "Volumetric error compensation model: Chebyshev coefficients over the nominal DH.",
    (
        whole("joint", "joint number, from 1", 1, JOINTS_MAX),
        text("error", "element of the error matrix of eq. 6", ERRORS),
        whole(
            "direction",
            "0 = both directions; -1 or +1 = offset added when the joint travels that way",
            None,
            None,
            choices=(-1, 0, 1),
        ),
        whole("order", "order of the Chebyshev polynomial, first kind", 0, 40),
        *same(
            BY_POSES,
            real("coefficient", _BY_ERROR, "coefficient of the polynomial", -1e3, 1e3),
        ),
        *same(
            BY_ROW,
            magnitude("std", _BY_ERROR, "standard deviation of the coefficient", 1e4, True),
        ),
        real("q_min_rad", "rad", f"joint position mapped to -1, {SLIDES}", -TRAVEL_MM, TRAVEL_MM),
        real("q_max_rad", "rad", f"joint position mapped to +1, {SLIDES}", -TRAVEL_MM, TRAVEL_MM),
        *_DH,
    ),
    ("joint", "error", "direction", "order"),
)
DH_MODEL = Artefact(
    "dh_model",
    "Fitted DH model, T = Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta) per joint.",
    (whole("joint", "joint number, from 1", 1, JOINTS_MAX), *_DH_FITTED, *_DH_STD),
    ("joint",),
)
_FRAME_KEY = ("model", "frame", "session")
VEC_FRAMES = Artefact(
    "vec_frames", "Frames estimated with the VEC model.", _FRAME_COLUMNS, _FRAME_KEY
)
FRAMES = Artefact("frames", "Frames of every model.", _FRAME_COLUMNS, _FRAME_KEY)
VEC_FIT = Artefact(
    "vec_fit",
    "How the VEC fit went: rank, singular values, prior, iterations, parameters.",
    _FIT_COLUMNS,
    ("quantity", "number", "parameter"),
)
VEC_ORDERS = Artefact(
    "vec_orders",
    "Orders of the VEC model tried by cross-validation, each with its best prior, and the one "
    "chosen: the lowest whose squared error exceeds the best by no more than one standard error.",
    (
        whole("fold", "fold the choice has not seen; null = it has seen all", nullable=True),
        whole("order", "order of the Chebyshev polynomials", 0, 40),
        magnitude("prior_std_mm", "mm", "prior standard deviation of delta coefficients", 1e3),
        magnitude("prior_std_mrad", "mrad", "prior standard deviation of eps coefficients", 1e3),
        real("prior_decay", "1", "factor on both from each order above the first", 0, 1),
        magnitude(
            "held_out_rms_mm",
            "mm",
            "position rms of rows left out of a fit, over configurations; far ones count less",
            1e4,
            True,
        ),
        magnitude("excess_mm2", "mm^2", "mean squared error beyond that of the best", 1e8, True),
        magnitude(
            "excess_std_error_mm2", "mm^2", "standard error of it, by configurations", 1e8, True
        ),
        whole("chosen", "1 = chosen", 0, 1),
    ),
    ("fold", "order"),
)
DH_FIT = Artefact(
    "dh_fit",
    "How the DH fit went: rank, singular values, truncation, iterations, parameters.",
    _FIT_COLUMNS,
    ("quantity", "number", "parameter"),
)
POSE_ERRORS = Artefact(
    "pose_errors",
    "Error vectors pose by pose, of the delivered models and of the cross-validated ones.",
    (
        text("comparison", "what is compared with what", COMPARISONS),
        text(
            "estimate",
            "train (delivered models) or cross_validated (the row was held out)",
            ESTIMATES,
        ),
        whole("row", "row of measurements.parquet, from 0"),
        whole("pose", "number of the joint configuration"),
        text("target", "name of the measured target"),
        whole("repeat", "number of the reading"),
        text("subset", "train or validation, as in measurements", SUBSETS),
        whole("fold", "fold in which the row is held out; null without folds", nullable=True),
        *error_vector("the position error"),
        *(
            real(
                f"r{axis}_mrad",
                "mrad",
                f"{axis} of the orientation error as a rotation vector, null for position only",
                -ERROR_MRAD,
                ERROR_MRAD,
                True,
            )
            for axis in "xyz"
        ),
    ),
    ("comparison", "estimate", "row"),
)
RESIDUALS = Artefact(
    "residuals",
    "Residual statistics: Table I (vec_vs_measured), Table III (dh_vs_vec) and the like.",
    (
        text("comparison", "what is compared with what", COMPARISONS),
        text("subset", "train or validation", SUBSETS),
        whole("fold", "held-out fold; null = pooled over folds, or no folds", nullable=True),
        text("quantity", "position or orientation", QUANTITIES),
        text("unit", "unit of the statistics", UNITS_OF_RESIDUALS),
        whole("n", "number of target points", 1),
        magnitude("mean", "see unit", "mean magnitude", 1e4),
        magnitude("max", "see unit", "largest magnitude", 1e4),
        magnitude("rms", "see unit", "root mean square of the magnitude", 1e4),
        magnitude("gamma99", "see unit", "99 % quantile of a fitted gamma distribution", 1e5, True),
    ),
    ("comparison", "subset", "fold", "quantity"),
)


def _body(mass: str, centre: str, of: str, nullable: bool = False) -> tuple[Column, ...]:
    """Columns of a mass, called ``mass``, and of its centre of gravity, ``<centre>_x_mm`` .."""
    return (
        real(mass, "kg", f"mass of {of}", 0.0, 1e4, nullable),
        *(
            real(f"{centre}_{axis}_mm", "mm", f"{axis} of the centre of {of}", -1e4, 1e4, nullable)
            for axis in "xyz"
        ),
    )


_COEFFICIENTS = (
    (
        "compliance_rad_per_nm",
        "rad/(N m)",
        "turn of the joint by a moment of gravity about it",
        1e-11,  # 1e-9 rad by the 100 N m of a heavy arm
    ),
    (
        "lever_coefficient_rad_per_mm",
        "rad/mm",
        "turn by the lever of the last origin: the product of a weight and the compliance",
        1e-12,  # 1e-9 rad by a lever of a metre
    ),
)
COMPLIANCE_MODEL = Artefact(
    "compliance_model",
    "Fitted DH arm whose joints turn further under gravity, by compliance times moment (masses "
    "known) and coefficient times lever (masses unknown: only the product can be seen).",
    (
        *DH_MODEL.columns,
        *(
            column
            for name, unit, meaning, within in _COEFFICIENTS
            for column in (
                *same(
                    BY_POSES,
                    real(name, unit, f"{meaning}, null where not fitted", -1.0, 1.0, True),
                ),
                *same(
                    within,
                    magnitude(
                        f"std_{name}",
                        unit,
                        f"standard deviation of {name}, null if undetermined or not fitted",
                        1e4,
                        True,
                    ),
                ),
            )
        ),
        *_body("link_mass_kg", "link", "the link, DH frame; null if not stated", True),
        *(
            real(f"gravity_{axis}", "1", f"{axis} of gravity's direction, first DH frame", -1, 1)
            for axis in "xyz"
        ),
        *_body("payload_kg", "payload", "the payload where a row states none"),
    ),
    ("joint",),
)
COMPLIANCE_FRAMES = Artefact(
    "compliance_frames", "Frames estimated with the compliance model.", _FRAME_COLUMNS, _FRAME_KEY
)
COMPLIANCE_FIT = Artefact(
    "compliance_fit",
    "How the compliance fit went: rank, singular values, truncation, iterations, parameters.",
    _FIT_COLUMNS,
    ("quantity", "number", "parameter"),
)
COMPLIANCE_COVARIANCE = Artefact(
    "compliance_covariance",
    "Covariance of DH parameters, coefficients and their frames in the directions the poses "
    "determine; the others are the undetermined_direction rows of compliance_fit.",
    DH_COVARIANCE.columns,
    DH_COVARIANCE.key,
)
ALL = (
    MEASUREMENTS,
    VEC_MODEL,
    VEC_FRAMES,
    VEC_FIT,
    VEC_ORDERS,
    DH_MODEL,
    FRAMES,
    DH_FIT,
    VEC_COVARIANCE,
    DH_COVARIANCE,
    DH_IDENTIFIED,
    COMPLIANCE_MODEL,
    COMPLIANCE_FRAMES,
    COMPLIANCE_FIT,
    COMPLIANCE_COVARIANCE,
    RESIDUALS,
    POSE_ERRORS,
)
