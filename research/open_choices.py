"""What the paper leaves open: every choice, its keys of the configuration and the values tried.

The only list of them: design, page and picture follow it. A choice is added by one entry.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from research.dotted import value_at

# What runs vary beside single choices: nothing, the arm, or several at once.
DEFAULT, ARM = "default", "arm"
SAMPLES = ALL, ALL_AND_ARM, FIG_5 = "all", "all_and_arm", "fig5"


@dataclass(frozen=True)
class Choice:
    """One choice: ``values`` are, by the word for each, the values of its ``keys``.

    ``about`` says in words what is chosen. The paper says nothing of the choices of ``OPEN``; it
    ``states`` those that are varied beside them for its Figs. 5 and 6.
    """

    name: str
    about: str
    keys: tuple[str, ...]
    values: Mapping[str, tuple[Any, ...]]

    def word(self, config: Mapping[str, Any]) -> str | None:
        """The word for what ``config`` chooses; None where that is none of the values tried."""
        own = tuple(value_at(config, key) for key in self.keys)
        return next((word for word, values in self.values.items() if values == own), None)


def _one(name: str, about: str, key: str, *values: Any) -> Choice:
    return Choice(name, about, (key,), {_word(value): (value,) for value in values})


def _word(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(map(_word, value))
    return f"{value:g}" if isinstance(value, (int, float)) else str(value)


# Down; leaning outward, where joint 5 reaches every turn, and inward, where its limit takes some
# away; level and pointing to the arm, as it is and turned about the tool.
ORIENTATIONS_DEG = (
    (180.0, 0.0, 0.0),
    (180.0, 45.0, 0.0),
    (180.0, -45.0, 0.0),
    (180.0, -90.0, 0.0),
    (180.0, -90.0, -30.0),
)
OPEN: tuple[Choice, ...] = (
    _one(
        "inner_radius",
        "distance from the first axis at which the evaluation space begins, mm",
        "evaluation.cylinder.inner_radius_mm",
        *(1100.0, 1150.0, 1200.0, 1250.0, 1300.0),
    ),
    _one(
        "floor",
        "height at which the evaluation space begins, mm",
        "evaluation.cylinder.bottom_mm",
        *(-100.0, -50.0, 0.0, 50.0, 100.0),
    ),
    _one(
        "tool",
        "tool centre point in the flange frame, mm",
        "evaluation.tool_mm",
        *([0.0, 0.0, 0.0], [0.0, 0.0, 50.0], [0.0, 0.0, 150.0], [100.0, 0.0, 100.0]),
    ),
    _one(
        "reference_orientation",
        "attitude of the flange before it is turned, intrinsic XYZ angles, deg",
        "evaluation.reference_orientation_deg",
        *(list(angles) for angles in ORIENTATIONS_DEG),
    ),
    _one(
        "reference_frame",
        "what keeps that attitude: the slice, with which it turns, or the robot's base",
        "evaluation.reference_frame",
        *("slice", "base"),
    ),
    _one(
        "rotations",
        "combinations of the turns by 45 degrees: the corners and none, or all 27",
        "evaluation.rotations",
        *("signs_and_zero", "all_27"),
    ),
    _one(
        "sequence",
        "quasi-random sequence of the operating points",
        "evaluation.sequence",
        *("sobol", "halton"),
    ),
    _one(
        "points_in",
        "operating points drawn as poses in the space, or as joints",
        "evaluation.points_in",
        *("space", "joints"),
    ),
    _one(
        "wrist",
        "wrist configurations of the operating points",
        "evaluation.wrist",
        *("both", "noflip", "flip"),
    ),
    _one(
        "visiting_order",
        "order in which the points are visited: as drawn, or shuffled in every simulation",
        "study.visiting_order",
        *("sequence", "shuffled"),
    ),
    _one(
        "invert_with",
        "model that gives the joints of a wanted pose",
        "evaluation.invert_with",
        *("dh", "vec", "nominal"),
    ),
    Choice(
        "travel_direction",
        "travel direction of the joints: left out, or fitted and taken as down or up",
        ("calibration.vec.travel_direction", "evaluation.travel_direction"),
        {"left_out": (False, 0), "down": (True, -1), "up": (True, 1)},
    ),
    _one(
        "poses",
        "number of calibration poses",
        "measurements.synthetic.poses",
        *(250, 400, 800),
    ),
    _one(
        "rotation_weight",
        "position error that weighs as much as one radian in the fits, mm",
        "calibration.rotation_weight_mm_per_rad",
        *(100.0, 250.0, 500.0, 1000.0),
    ),
    _one(
        "vec_order",
        "order of the Chebyshev polynomials of the VEC model",
        "calibration.vec.order",
        *(4, 5, 6, 8),
    ),
    Choice(
        "roughness",
        "how rough the arm's errors are over a joint: fall of their waves, size of gear errors",
        ("measurements.synthetic.wave_decay", "measurements.synthetic.ripple"),
        {
            "smoother": (2.0, 1.0),
            "as_tuned": (1.0, 1.0),
            "rougher": (0.5, 1.0),
            "gears_twice": (1.0, 2.0),
            "no_gears": (1.0, 0.0),
        },
    ),
    _one(
        "outlier_rule",
        "rule for the cut of outlier rejection",
        "study.outlier_rule",
        *("normal", "gamma", "iqr"),
    ),
    _one(
        "distance",
        "what the probability of a measurement is taken at: squared distance, or as printed",
        "study.distance",
        *("squared", "as_printed"),
    ),
    _one(
        "covariance",
        "what the covariance of an average is divided by: readings, or their root as printed",
        "study.covariance",
        *("r", "sqrt_r"),
    ),
    _one(
        "search",
        "which bound counts as the smallest that did not reject",
        "study.search",
        *("from_above", "from_below", "bisection"),
    ),
)

# Stated by the paper for its single runs: varied with the arm for Figs. 5 and 6 alone.
STATED: tuple[Choice, ...] = (
    _one("alpha", "threshold on the rejection probability", "study.alpha", 0.5, 0.6, 0.7, 0.8),
    _one(
        "fig5_noise",
        "noise of the simulations of Figs. 5 and 6, standard deviation per axis, mm",
        "histories.noise_mm",
        *(0.1, 0.2, 0.3, 0.4),
    ),
    _one("seed", "seed of the random numbers", "seed", *range(20240, 20245)),
)


def named(names: tuple[str, ...] | list[str]) -> tuple[Choice, ...]:
    """The open choices of these names, all of them if there is none."""
    return tuple(each for each in OPEN if not names or each.name in names)
