"""Contract of the tables that say how sure a fit is of everything it estimated."""

from __future__ import annotations

from kinacc.tables.columns import BY_STD, Artefact, magnitude, real, same, text

_NAMES = (
    "base.x_mm .. base.rz_rad (base in the instrument's frame), tool.x_mm .. (target in the flange "
    "frame), then the model's own"
)
_COLUMNS = (
    text("parameter", f"an estimated parameter: {_NAMES}"),
    text("other", "the same parameter (its variance) or one before it"),
    *same(
        BY_STD,
        real(
            "covariance",
            "product of the units of both",
            "covariance; mm for lengths and delta, rad for angles and eps",
        ),
        real(
            "correlation", "1", "correlation; null where one of both is undetermined", -1, 1, True
        ),
    ),
)
VEC_COVARIANCE = Artefact(
    "vec_covariance",
    "Posterior covariance of the VEC coefficients and the frames estimated with them.",
    _COLUMNS,
    ("parameter", "other"),
)
DH_COVARIANCE = Artefact(
    "dh_covariance",
    "Covariance of the DH parameters and their frames in the directions the poses determine; the "
    "others are the undetermined_direction rows of dh_fit.",
    _COLUMNS,
    ("parameter", "other"),
)
DH_IDENTIFIED = Artefact(
    "dh_identified",
    "Which parameters of the DH fit the training rows determine, and in words which they cannot "
    "tell apart. Undetermined: directions whose singular value, base and targets projected out, is "
    "below calibration.dh.truncation of the largest hold more than 1 % of the parameter.",
    (
        text("parameter", f"a parameter: {_NAMES}"),
        text(
            "status",
            "identified; prior: known beforehand; undetermined; fixed: not fitted",
            ("identified", "prior", "undetermined", "fixed"),
        ),
        magnitude(
            "std", "see unit", "standard deviation, null if undetermined or fixed", 1e6, True
        ),
        text("unit", "unit of std", ("mm", "rad")),
        magnitude(
            "undetermined_share",
            "1",
            "length of its part in undetermined directions of unit length (mm and mrad)",
            1e6,
        ),
        text("statement", "why it is not identified; null where it is", nullable=True),
    ),
    ("parameter",),
)
