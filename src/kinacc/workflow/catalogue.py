"""Every stage of the study: what it reads, what it leaves and what it depends on.

The one list the workflow, the command line and the check of a results folder share. Importing it
costs nothing but the standard library.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from kinacc.artifacts.error_models import ALWAYS, FITTED

FIGURE_FOLDER = "figures"
TABLES, FIGURE, PAGE = "tables", "figure", "page"  # what a stage leaves


@dataclass(frozen=True)
class Stage:
    """One step of the study.

    ``message`` says in words what it does. ``inputs`` and ``outputs`` are artefact names of the
    data set. ``settings`` are dotted key paths of the data set's configuration, with
    ``synthetic_settings`` where its arm is synthetic, ``files`` those
    whose values name files it reads; nothing else of the configuration reaches the stage.
    ``uses`` are files of the package and registries of modules that its module does not import
    (:func:`kinacc.artifacts.provenance.code_hash`); ``{robot}`` stands for the value, or each of
    the values, of that setting, ``{models}`` for each kind of error model whose table it reads or
    leaves, ``{fits}`` for the kind it fits.
    ``optional`` inputs are used by data sets that have them. ``after`` are artefacts that have to
    be there, where the data set has them, and are not read. ``scattered`` stages run once per
    part of the work; an input that is scattered arrives as one table. ``on_request`` stages are not
    part of a plain run; ``measured`` ones are of data sets whose measurements stand in a file;
    those ``of_lines`` read the ``inputs`` of the data set of every line of the series;
    ``fits`` is the kind of error model a stage fits;
    ``shared`` ones take long enough to be kept for other folders (Snakemake's cache);
    ``leaves`` says what its files are: tables, a figure (see :func:`_figure`), a page.
    """

    name: str
    message: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    settings: tuple[str, ...] = ()
    synthetic_settings: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    scattered: bool = False
    on_request: bool = False
    measured: bool = False
    of_lines: bool = False
    shared: bool = False
    fits: str = ""
    leaves: str = TABLES

    @property
    def is_figure(self) -> bool:
        """Whether it draws a figure, once for every format."""
        return self.leaves == FIGURE

    @property
    def by_choice(self) -> bool:
        """Whether data sets are without it by what they are or ask for: nobody need be told."""
        return self.measured or bool(self.fits) or self.name in HISTORY

    @property
    def module(self) -> str:
        """Name of the module whose ``run`` does the work."""
        if self.is_figure:
            return f"kinacc.figures.{self.name}"
        return f"kinacc.workflow.stages.{'error_model' if self.fits else self.name}"

    def used(
        self, settings: Mapping[str, object], inputs: Iterable[str] | None = None
    ) -> tuple[str, ...]:
        """``uses`` with the values of settings put in; those of settings not given are left out.

        ``inputs``: artefacts it reads, where optional ones are among them.
        """
        found: dict[str, None] = {}
        read = self.inputs if inputs is None else (role.rpartition("/")[2] for role in inputs)
        there = {*read, *self.outputs}
        models = [kind for kind in FITTED if f"{kind}_model" in there]
        settings = {**settings, "models": models, "fits": self.fits}
        for use in self.uses:
            (key,) = re.findall(r"{(\w+)}", use) or ("",)
            values: Any = settings.get(key, ()) if key else ("",)
            values = [values] if isinstance(values, str) else values
            found |= dict.fromkeys(use.replace(f"{{{key}}}", value) for value in values)
        return tuple(found)


def _figure(
    name: str,
    message: str,
    inputs: tuple[str, ...] = (),
    settings: tuple[str, ...] = (),
    files: tuple[str, ...] = (),
    uses: tuple[str, ...] = (),
) -> Stage:
    """The stage that draws ``figures/<name>`` by the ``run`` of ``kinacc.figures.<name>``."""
    return Stage(
        name,
        message,
        inputs,
        (name,),
        settings,
        files=files,
        uses=uses,
        leaves=FIGURE,
    )


_ROBOT = "kinematics/robots/{robot}.yaml"
_DRAWS = "synthetic/accepted_draws.csv"
_READINGS = ("study.outlier_rule", "study.distance", "study.covariance", "study.search")
_ATTITUDE = ("evaluation.reference_orientation_deg", "evaluation.reference_frame")
_MODELS = (*(f"{kind}_model" for kind in ALWAYS), "frames")
_FITS_OF_ALL = tuple(f"{kind}_{what}" for kind in FITTED for what in ("fit", "covariance"))
_FURTHER = tuple(f"{kind}_model" for kind in FITTED if kind not in ALWAYS)
_MODEL = "kinacc.artifacts.error_models:MODELS[{models}]"
_ESTIMATOR = "kinacc.artifacts.error_models:ESTIMATORS"
_FITS = (_ROBOT, _MODEL, f"{_ESTIMATOR}[{{fits}}]")


STAGES: dict[str, Stage] = {
    stage.name: stage
    for stage in (
        Stage(
            "measurements",
            "reading or synthesising the measured poses",
            (),
            ("measurements", "robot"),
            ("seed", "robot", "measurements"),
            synthetic_settings=_ATTITUDE,  # of the poses planned
            files=("robot", "measurements.file.path", "measurements.file.joints.path"),
            uses=(_ROBOT, _DRAWS),
        ),
        Stage(
            "data_check",
            "checking the measured file before anything is fitted to it",
            (),
            ("data_check",),
            ("robot", "measurements", "calibration", "data_check"),
            files=("robot", "measurements.file.path", "measurements.file.joints.path"),
            uses=(_ROBOT,),
            measured=True,
        ),
        Stage(
            "vec",
            "fitting the volumetric error compensation (VEC) model to the training poses",
            ("measurements",),
            ("vec_model", "vec_frames", "vec_fit", "vec_covariance", "vec_orders"),
            (
                "robot",
                "calibration.rotation_weight_mm_per_rad",
                "calibration.base_and_tool",
                "calibration.frames",
                "calibration.vec",
            ),
            files=("robot",),
            uses=_FITS,
            after=("data_check",),
            shared=True,
            fits="vec",
        ),
        Stage(
            "compliance",
            "fitting the DH model with joints that bend under gravity",
            ("measurements",),
            ("compliance_model", "compliance_frames", "compliance_fit", "compliance_covariance"),
            (
                "robot",
                "calibration.rotation_weight_mm_per_rad",
                "calibration.base_and_tool",
                "calibration.frames",
                "calibration.dh",
                "calibration.compliance",
            ),
            files=("robot",),
            uses=_FITS,
            after=("data_check",),
            shared=True,
            fits="compliance",
        ),
        Stage(
            "dh",
            "fitting the DH model by least squares",
            ("measurements", "vec_model", "vec_frames"),
            ("dh_model", "frames", "dh_fit", "dh_covariance", "dh_identified"),
            (
                "robot",
                "calibration.rotation_weight_mm_per_rad",
                "calibration.base_and_tool",
                "calibration.frames",
                "calibration.dh",
            ),
            files=("robot",),
            uses=_FITS,
            optional=tuple(name.replace("_model", "_frames") for name in _FURTHER),
            shared=True,
            fits="dh",
        ),
        Stage(
            "residuals",
            "comparing models and measurements, at held-out poses too",
            ("measurements", *_MODELS, "vec_orders"),
            ("residuals", "pose_errors", "model_selection", "joint_bias", "worst_rows"),
            ("robot", "calibration"),
            files=("robot",),
            uses=(_ROBOT, _MODEL, f"{_ESTIMATOR}[{{models}}]"),
            optional=_FURTHER,
        ),
        Stage(
            "excluded_rows",
            "saying how far off the excluded rows are",
            ("measurements", *_MODELS),
            ("excluded_rows",),
            ("robot", "measurements"),
            files=("robot", "measurements.file.path", "measurements.file.joints.path"),
            uses=(_ROBOT, _MODEL),
            optional=_FURTHER,
            measured=True,
        ),
        Stage(
            "summary",
            "summing up what the calibration is worth",
            (
                "measurements",
                "robot",
                *_MODELS,
                "dh_identified",
                "pose_errors",
                "model_selection",
            ),
            ("summary",),
            ("robot", "tolerance"),
            files=("robot",),
            uses=(_ROBOT, _MODEL),
            optional=(
                *("data_check", "excluded_rows", "vec_orders", *_FURTHER),
                *_FITS_OF_ALL,
            ),
        ),
        Stage(
            "history",
            "holding the calibrations of a series to one another",
            ("measurements", "robot", *_MODELS, "pose_errors", "model_selection"),
            ("history",),
            ("seed", "series", "calibration", "tolerance.mm"),
            uses=(_MODEL,),
            optional=_FURTHER,
            of_lines=True,
        ),
        _figure(
            "history_over_time",
            "drawing the history of the arm",
            ("history",),
            ("dataset",),
        ),
        Stage(
            "accuracy_map",
            "mapping the largest error over the slices of the evaluation space (Fig. 3)",
            _MODELS,
            ("accuracy_map",),
            (
                "robot",
                "evaluation.cylinder",
                *_ATTITUDE,
                "evaluation.rotation_deg",
                "evaluation.rotations",
                "evaluation.tool_mm",
                "evaluation.invert_with",
                "evaluation.travel_direction",
                "map",
            ),
            files=("robot",),
            uses=(_ROBOT, _MODEL),
        ),
        Stage(
            "assessment_points",
            "choosing the operating points of the study and their errors",
            ("measurements", *_MODELS, "pose_errors"),
            ("assessment_points",),
            ("robot", "evaluation"),
            files=("robot",),
            uses=(_ROBOT, _MODEL),
        ),
        Stage(
            "study_chunk",
            "simulating the assessors under noise",
            ("assessment_points",),
            ("study_chunk",),
            (
                "seed",
                "study.noise_mm",
                "study.repetitions",
                "study.measurements",
                "study.alpha",
                "study.visiting_order",
            ),
            scattered=True,
            shared=True,
        ),
        Stage(
            "study",
            "gathering the simulations and summing them up (Fig. 4)",
            ("study_chunk", "assessment_points"),
            ("study", "study_summary", "readings"),
            _READINGS,
        ),
        Stage(
            "histories",
            "following single model invalidations step by step (Figs. 5 and 6)",
            ("assessment_points",),
            ("histories",),
            (
                "seed",
                "study.measurements",
                "study.alpha",
                "study.distance",
                "study.covariance",
                "study.visiting_order",
                "histories",
            ),
        ),
        _figure("fig1", "drawing Fig. 1, the one-dimensional example"),
        _figure(
            "fig2",
            "drawing Fig. 2, the arm over its evaluation space",
            ("dh_model", "frames", "assessment_points"),
            (
                "dataset",
                "robot",
                "evaluation.space",
                "evaluation.cylinder",
                "evaluation.tool_mm",
            ),
            files=("robot",),
            uses=(_ROBOT,),
        ),
        _figure("fig3", "drawing Fig. 3, the accuracy maps", ("accuracy_map",), ("dataset",)),
        _figure(
            "fig4",
            "drawing Fig. 4, assessed accuracy against noise",
            ("study_summary", "assessment_points"),
            ("dataset", "evaluation.space", "measurements.source"),
        ),
        _figure(
            "fig5",
            "drawing Fig. 5, a model that is invalidated",
            ("histories", "assessment_points"),
            ("dataset", "evaluation.space", "measurements.source"),
        ),
        _figure(
            "fig6",
            "drawing Fig. 6, a model that cannot be invalidated",
            ("histories", "assessment_points"),
            ("dataset", "evaluation.space", "measurements.source"),
        ),
        Stage(
            "claims",
            "holding the paper's numbers and sentences to the results",
            (
                "residuals",
                "dh_model",
                "assessment_points",
                "study",
                "study_summary",
                "readings",
                "histories",
            ),
            ("claims",),
            ("robot",),
            optional=("accuracy_map", "robustness"),
        ),
        Stage(
            "report",
            "writing the page that says what it is all worth",
            (
                *("measurements", "robot", *_MODELS, "dh_identified", "pose_errors"),
                *("model_selection", "residuals", "worst_rows", "summary"),
            ),
            ("report",),
            ("dataset",),
            uses=(*(f"report/templates/page.{kind}" for kind in ("html", "css", "js")), _MODEL),
            optional=(
                *("data_check", "excluded_rows", "vec_orders", *_FURTHER, *_FITS_OF_ALL),
                *("accuracy_map", "assessment_points", "study", "study_summary", "readings"),
                *("histories", "claims", "history"),
            ),
            leaves=PAGE,
        ),
        Stage(
            "robustness_chunk",
            "going through fits, study and claims with further draws of the arm",
            (),
            ("robustness_chunk",),
            (
                *("seed", "robot", "measurements", "calibration", "evaluation", "map"),
                *("study", "histories", "robustness"),
            ),
            files=("robot",),
            uses=(_ROBOT, _DRAWS, *(f"{_ESTIMATOR}[{kind}]" for kind in ALWAYS)),
            scattered=True,
            on_request=True,
            shared=True,
        ),
        Stage(
            "robustness_table",
            "gathering the claims on further draws of the arm",
            ("robustness_chunk",),
            ("robustness",),
            on_request=True,
        ),
    )
}

# Of a data set with a series: what its calibrations say of one another.
HISTORY = ("history", "history_over_time")
# The stages of a calibration; maps, the study of assessors and the paper's claims go on from there.
CALIBRATION = (
    "measurements",
    "data_check",
    "vec",
    "dh",
    "residuals",
    "excluded_rows",
    "summary",
    *HISTORY,
)


@cache
def maker_of(artefact: str) -> Stage:
    """The stage that leaves an artefact."""
    return next(stage for stage in STAGES.values() if artefact in stage.outputs)


@cache
def stages_below(name: str) -> int:
    """How many stages wait for one, in the longest chain of them."""
    made = set(STAGES[name].outputs)
    below = [
        each.name for each in STAGES.values() if made.intersection((*each.inputs, *each.optional))
    ]
    return max((1 + stages_below(each) for each in below), default=0)
