"""What a run ends with: half a page on what the calibration of a data set is worth."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kinacc.calibration import misfit, noise, summary
from kinacc.calibration.summary import Fact, of
from kinacc.calibration.summary_words import half_page, paragraph
from kinacc.campaign import journal, of_calibration, slips
from kinacc.campaign.of_calibration import Sought
from kinacc.campaign.words import one_of
from kinacc.config.error_models import ERROR_MODELS, PLAINEST, model_name
from kinacc.deployment import folder as results
from kinacc.deployment.history_words import sentence
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import quaternion_from_rotation
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState
from kinacc.kinematics.robot import Robot
from kinacc.study.summary import claims_counted, claims_that_differ, differences
from kinacc.tables import store
from kinacc.tables.columns import Columns

IF_THERE = (
    *(f"{kind}_model" for kind in ERROR_MODELS),
    *("summary", "data_check", "excluded_rows", "vec_orders", "accuracy_map"),
    *("assessment_points", "claims", "history"),
)
# What the page shows: it needs the first, and shows of the others what is there.
PAGE_TABLES = (*summary.TABLES, "dh_model", "vec_model", "residuals", "worst_rows", "summary")
ON_PAGE = (
    *IF_THERE,
    *(f"{kind}_{what}" for kind in ERROR_MODELS for what in ("fit", "covariance")),
    *("study", "study_summary", "readings", "histories"),
)
_READINGS = 300  # for the 200 candidates that are drawn: bounds as wide as repeats make them
_LEAST_RANGE, _METRE_MM = 1e-9, 1e3
Tables = Mapping[str, Columns]


def read(
    folder: Path | str,
    needed: Collection[str] = summary.TABLES,
    optional: Collection[str] = IF_THERE,
) -> dict[str, Columns]:
    """The tables an answer is made from. Raises InputError naming all ``needed`` ones missing."""
    folder = Path(folder)
    if (folder / journal.PLAN).is_file():
        status = shlex.join(["kinacc", "campaign", "status", str(folder)])
        fix = f"ask {status}, or name its results folder"
        raise InputError(Problem(str(folder), "is a campaign, and no results folder", fix=fix))
    refuse(
        [
            Problem(str(folder / f"{name}.parquet"), "no such file", fix="run the workflow first")
            for name in needed
            if not (folder / f"{name}.parquet").is_file()
        ],
        f"{folder} holds no calibration that is complete",
    )
    paths = {name: folder / f"{name}.parquet" for name in dict.fromkeys((*needed, *optional))}
    return {name: store.read(path) for name, path in paths.items() if path.is_file()}


def facts_of(tables: Tables) -> list[Fact]:
    """The facts of ``summary`` from the tables of a results folder."""
    arm = _robot(tables)
    known = tables.get("summary", {"topic": [], "value": []})
    share = np.asarray(known["value"])[np.asarray(known["topic"]) == "like_measured"]
    found = summary.facts(tables, arm, float(share[0]) if len(share) else np.nan)
    if "summary" in tables:  # no other table holds it
        told = summary.facts_in(tables["summary"])
        found += [each for each in told if each.topic == "tolerance"]
    return found


def campaign_of(folder: Path | str, tables: Tables) -> Sought:
    """The campaign of a results folder with these tables; see :func:`journal.of_results`."""
    name = Path(folder).resolve().name
    return of_calibration.sought(name, tables, journal.of_results(Path(folder)))


class Told(NamedTuple):
    """What there is to tell of a results folder, as texts under names.

    ``claims`` are about the paper, empty where its claims are not held to these results; ``other``
    errors are of populations beside held-out and training poses; ``following`` are commands.
    """

    facts: list[Fact]
    claims: dict[str, list[str]]
    other: list[str]
    largest: list[str]
    following: list[str]


def told(
    folder: Path, tables: Tables, bound: Sought, whole: bool, campaign: str, exported: str
) -> Told:
    """What is to be told of the tables of a results folder and its campaign.

    ``campaign`` and ``exported`` are names for folders that the commands would make.
    """
    facts, arm = facts_of(tables), _arm(tables)
    asked = _noise(facts, tables, arm.robot)
    commands = [] if bound.assessed is None else [bound.assessed.next_command]
    return Told(
        facts,
        _claims(folder, facts, tables),
        _other_errors(facts, tables, whole),
        _bound(bound, folder, arm, asked, campaign),
        [*commands, *_uses(folder, arm, tables, exported)],
    )


def answer(
    folder: Path | str, tables: Tables, whole: bool = False, following: Sequence[str] = ()
) -> list[str]:
    """The half page on a results folder; with the paper's claims first where it has them.

    ``whole`` leaves nothing out; ``following`` are commands to name beside the next ones.
    """
    folder = Path(folder)
    name, bound = folder.resolve().name, campaign_of(folder, tables)
    found = told(folder, tables, bound, whole, _free("check", folder), _free("exported", folder))
    more = shlex.join(["kinacc", "fitted", str(folder), "--all"])
    own = 0 if bound.assessed is None else 1  # a campaign's next command goes first
    commands = [*found.following[:own], *following, *found.following[own:]]
    fits = misfit.misfits(tables, _robot(tables))
    claims = [line for each in found.claims.items() for line in paragraph(*each)]
    return [
        *([f"{name}: the paper reproduced", *claims, ""] if claims else []),
        f"{name}: what its calibration is worth",
        *half_page(found.facts, more, whole),
        *paragraph("std deviations", [misfit.in_words(fits)]),
        *paragraph("other errors", found.other),
        *paragraph("largest error", found.largest),
        *paragraph("history", [sentence(tables["history"])] if "history" in tables else []),
        *paragraph("next", commands),
        *paragraph("page", [str(page)] if (page := folder / "report.html").is_file() else []),
    ]


def _other_errors(facts: Sequence[Fact], tables: Tables, whole: bool) -> list[str]:
    """Populations beside held-out and training errors, a line each."""
    points, synthetic = tables.get("assessment_points"), _is_synthetic(facts)
    lines = []
    if whole or (points is not None and synthetic):
        populations = {
            "model_difference": "at the poses that were fitted",
            "held_out_model_difference": "at held-out poses, models fitted without them",
        }
        for topic, where in populations.items():
            for item, known in of(facts, topic).items():
                pair = " to ".join(map(model_name, item.split("_vs_")))
                called = topic.replace("_", " ").replace("held out", "held-out")
                lines.append(f"{called}: at most {known['largest'].value:.3f} mm {where}, {pair}")
    if points is not None:
        lines += differences(points, tables["measurements"], tables.get("accuracy_map"))
    return lines


def _is_synthetic(facts: Sequence[Fact]) -> bool:
    return of(facts, "data")["measurements"]["source"].text == "synthetic"


def _arm(tables: Tables) -> Calibration:
    """The calibration that the commands of campaigns and poses would use."""
    return results.calibration(tables, _robot(tables))


def _robot(tables: Tables) -> Robot:
    return robot.of_text(str(tables["robot"]["description"][0]), "robot.parquet")


def _noise(facts: Sequence[Fact], tables: Tables, arm: Robot) -> str:
    """What a campaign has to be told of the noise, and what the readings tell of it."""
    asked = "NOISE: standard deviation of one reading, mm"
    if _is_synthetic(facts):
        return asked
    least = slips.noise_in_brief(noise.of_measurements(tables["measurements"], arm))
    return f"{asked}, at least this: {least}" if least else "NOISE: std of ten visits to a pose, mm"


def _bound(bound: Sought, folder: Path, arm: Calibration, noise: str, campaign: str) -> list[str]:
    if bound.assessed is not None:
        return [*bound.assessed.in_words(), *bound.remarks]
    words = ["kinacc", "campaign", "start", campaign, "--calibration", str(folder)]
    return [
        *bound.remarks,
        f"not assessed; a campaign bounds it ({noise}):",
        *one_of(arm.default_point, [*arm.targets]),
        f"{shlex.join(words)} --noise-mm NOISE --budget {_READINGS}",
    ]


def _uses(folder: Path, arm: Calibration, tables: Tables, exported: str) -> list[str]:
    """Commands that use the calibration: files for controllers, and joints for a pose."""
    names = [f"q{joint + 1}" for joint in range(len(arm.robot.q_min_rad))]
    near = _easy(arm, np.stack([tables["measurements"][name] for name in names], axis=1))
    pose = arm.pose(JointState(arm.robot.dh_joints(near[None])))
    numbers = [f"{each:.1f}" for each in pose.position_mm[0]]
    numbers += [f"{each:.4f}" for each in quaternion_from_rotation(pose.rotation[0])]
    shown = np.where(arm.robot.dh.prismatic, near, np.rad2deg(near)).round() + 0.0  # no minus zero
    chosen = [] if arm.choice == PLAINEST else ["--model", arm.choice]
    export = ["kinacc", "export", str(folder), *chosen, "--out", exported]
    use = ["kinacc", "compensate", str(folder), "--pose", ",".join(numbers)]
    use += ["--near-deg", ",".join(f"{each:.0f}" for each in shown)]
    return [shlex.join(export), shlex.join(use)]


def _easy(arm: Calibration, joints: np.ndarray) -> np.ndarray:
    """Of measured joints (n, k) the row farthest from singular, well within their ranges."""
    spread = np.abs(joints - joints.mean(axis=0)) / (np.ptp(joints, axis=0) + _LEAST_RANGE)
    inner = joints[np.argsort(spread.max(axis=1), kind="stable")[: len(joints) // 4 + 1]]
    slopes = arm.joint_jacobian(JointState(arm.robot.dh_joints(inner)))
    slopes[:, :3] /= _METRE_MM  # a millimetre counts as a milliradian
    return inner[np.argmax(np.linalg.svd(slopes, compute_uv=False)[:, -1])]


def _free(name: str, folder: Path) -> str:
    """The name of a new folder here, with that of the results where it is taken."""
    return name if not Path(name).exists() else f"{name}_{folder.resolve().name}"


def _claims(folder: Path, facts: Sequence[Fact], tables: Tables) -> dict[str, list[str]]:
    """What became of the paper's claims, where they are held to these results."""
    if "claims" not in tables or not _is_synthetic(facts):
        return {}
    claims = tables["claims"]
    return {
        "claims": [claims_counted(claims), f"{folder}/claims.parquet has each of them"],
        "differ": [", ".join(claims_that_differ(claims))],
        "figures": [f"{folder}/figures: fig1 to fig6"],
    }
