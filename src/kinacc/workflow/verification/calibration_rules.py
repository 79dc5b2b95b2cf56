"""What tables from measured poses to residuals must say of each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinacc.artifacts.columns import TURN_RAD
from kinacc.artifacts.error_models import ALWAYS, FITTED, NOMINAL, PLAINEST, comparisons
from kinacc.errors import InputError, Problem
from kinacc.workflow.verification.rule import TOLERANCE, Columns, Rule, Tables, mark

_SAME_CONFIGURATION_RAD = np.deg2rad(0.1)  # readings of one pose state where the arm then was


def _unit_quaternions(name: str) -> Rule:
    def rule(tables: Tables) -> Iterator[Problem]:
        parts = np.stack([tables[name][column] for column in ("qw", "qx", "qy", "qz")])
        null = np.isnan(parts)
        yield from mark(
            name, null.any(axis=0) != null.all(axis=0), "quaternion null in part", "all or none"
        )
        length = np.linalg.norm(parts, axis=0)
        wrong = np.abs(length - 1.0) > 1e-6
        yield from mark(name, wrong, "quaternion not of length 1", "unit quaternions")
        yield from mark(name, parts[0] < -TOLERANCE, "quaternion with qw < 0", "qw >= 0")

    return rule


def _measurements(tables: Tables) -> Iterator[Problem]:
    table = tables["measurements"]
    joints = np.stack(
        [values for name, values in table.items() if name[0] == "q" and name[1:].isdigit()]
    )
    first = np.unique(table["pose"], return_index=True, return_inverse=True)
    moved = np.abs(joints - joints[:, first[1]][:, first[2]]) > _SAME_CONFIGURATION_RAD
    yield from mark(
        "measurements", np.any(moved, axis=0), "pose at other joints", "one configuration"
    )
    for name in ("fold", "subset"):
        values = table[name].astype(str)
        wrong = values != values[first[1]][first[2]]
        yield from mark("measurements", wrong, f"pose in another {name}", f"one {name} per pose")


def _frames(name: str, models: tuple[str, ...]) -> Rule:
    def rule(tables: Tables) -> Iterator[Problem]:
        present = set(zip(tables[name]["model"], tables[name]["frame"], strict=True))
        targets = dict.fromkeys(str(each) for each in tables["measurements"]["target"])
        for model in models:
            for frame in ("base", *targets):
                if (model, frame) not in present:
                    what = f"no {frame} of model {model}"
                    allowed = "base and every measured target of every model"
                    yield Problem(f"{name}.parquet", what, allowed)

    return rule


def _frames_kept(kind: str) -> Rule:
    def rule(tables: Tables) -> Iterator[Problem]:
        before, after = tables[f"{kind}_frames"], tables["frames"]
        kept = {row[:2]: row[2:] for row in _frame_rows(after, kind)}
        for row in _frame_rows(before, kind):
            if kept.get(row[:2]) != row[2:]:
                what = f"frame {row[0]} of model {kind} differs from {kind}_frames.parquet"
                yield Problem("frames.parquet", what, f"the frames of the {kind} fit")

    return rule


def _frame_rows(table: Columns, kind: str) -> list[tuple]:
    names = [name for name in table if name not in ("model", "frame", "session")]
    sessions = table.get("session", np.full(len(table["frame"]), None))
    return [
        (table["frame"][i], sessions[i], *(float(table[name][i]) for name in names))
        for i in np.flatnonzero(table["model"] == kind)
    ]


def _every_joint(name: str) -> Rule:
    def rule(tables: Tables) -> Iterator[Problem]:
        joints = sorted({int(joint) for joint in tables[name]["joint"]})
        measured = tables["measurements"]
        count = sum(column[0] == "q" and column[1:].isdigit() for column in measured)
        if joints != list(range(1, count + 1)):
            what = f"joints {', '.join(map(str, joints))}"
            yield Problem(f"{name}.parquet", what, f"1 to {count}, as in measurements.parquet")

    return rule


def _vec_model(tables: Tables) -> Iterator[Problem]:
    table = tables["vec_model"]
    yield from mark(
        "vec_model", table["q_min_rad"] >= table["q_max_rad"], "empty joint range", "q_min < q_max"
    )
    turning = (table["direction"] != 0) & (table["error"] != "eps_z")
    yield from mark("vec_model", turning, "travel direction", "only in eps_z (eq. 6)")
    first = np.unique(table["joint"], return_index=True, return_inverse=True)
    for name in (
        "q_min_rad",
        "q_max_rad",
        "theta_offset_rad",
        "d_mm",
        "a_mm",
        "alpha_rad",
        "beta_rad",
    ):
        wrong = table[name] != table[name][first[1]][first[2]]
        yield from mark("vec_model", wrong, f"another {name}", "one value per joint")


def _residuals(tables: Tables) -> Iterator[Problem]:
    table = tables["residuals"]
    kinds = list(zip(table["comparison"], table["subset"], table["quantity"], strict=True))
    pooled = np.isnan(table["fold"])
    for kind in dict.fromkeys(kinds):
        count = sum(bool(pooled[i]) for i, each in enumerate(kinds) if each == kind)
        if count != 1:
            what = f"{count} pooled rows of {', '.join(kind)}"
            yield Problem("residuals.parquet", what, "exactly one (fold null)")
    for wanted in comparisons((*ALWAYS, NOMINAL)):
        if (wanted.name, "train", "position") not in kinds:
            yield Problem("residuals.parquet", f"no row {wanted.name}, train, position")
    right = np.where(table["quantity"] == "position", "mm", "mrad")
    yield from mark("residuals", table["unit"] != right, "unit", "position mm, orientation mrad")
    slack = 1.0 + TOLERANCE
    yield from mark(
        "residuals",
        (table["rms"] > table["max"] * slack) | (table["mean"] > table["rms"] * slack),
        "mean, rms and max out of order",
        "mean <= rms <= max",
    )


def _residuals_told(tables: Tables) -> Iterator[Problem]:
    """Statistics are those of the error vectors beside them."""
    table, errors = tables["residuals"], tables["pose_errors"]
    sizes = {
        "position": np.sqrt(sum(errors[f"e{axis}_mm"] ** 2 for axis in "xyz")),
        "orientation": np.sqrt(sum(errors[f"r{axis}_mrad"] ** 2 for axis in "xyz")),
    }
    for i, subset in enumerate(table["subset"]):
        fold, pooled = table["fold"][i], np.isnan(table["fold"][i])
        if subset == "train" and not pooled:
            continue  # of a fold's own fit, whose training errors are not kept
        estimate = "train" if subset == "train" else "cross_validated"
        chosen = (errors["comparison"] == table["comparison"][i]) & (errors["estimate"] == estimate)
        values = sizes[table["quantity"][i]][chosen & (pooled | (errors["fold"] == fold))]
        values = values[np.isfinite(values)]
        right = {"n": float(values.size)}
        if values.size:
            right |= {"mean": values.mean(), "max": values.max()}
            right["rms"] = np.sqrt(np.mean(values**2))
        for name, value in right.items():
            if not np.isclose(table[name][i], value, rtol=1e-9, atol=1e-9):
                allowed = f"{value:g}, computed from pose_errors.parquet"
                what = f"{name} {table[name][i]:g}"
                yield Problem(f"residuals.parquet, row {i}", what, allowed)


def _pose_errors(tables: Tables) -> Iterator[Problem]:
    errors, measured = tables["pose_errors"], tables["measurements"]
    row = errors["row"]
    beyond = row >= len(measured["pose"])
    yield from mark("pose_errors", beyond, "no such row", "rows of measurements.parquet")
    row = np.where(beyond, 0, row)
    for name in ("pose", "target", "repeat", "subset"):
        wrong = ~beyond & (errors[name] != measured[name][row])
        yield from mark("pose_errors", wrong, f"another {name}", "as in the row of measurements")


def _turns(name: str, columns: tuple[str, ...]) -> Rule:
    """Joints that turn stay within two turns; the table has one row per joint where it names it."""

    def rule(tables: Tables) -> Iterator[Problem]:
        table, slides = tables[name], _slides(tables["robot"])
        for column in columns or [each for each in table if each[0] == "q" and each[1:].isdigit()]:
            values = np.asarray(table[column], dtype=float)
            joint = np.asarray(table["joint"], dtype=int) if columns else int(column[1:])
            turning = ~np.isin(joint, slides)
            wrong = turning & (np.abs(values) > TURN_RAD)
            yield from mark(name, wrong, f"{column} beyond two turns", f"at most {TURN_RAD:g} rad")

    return rule


def _slides(table: Columns) -> list[int]:
    """Joints (from 1) of the described arm that slide."""
    from kinacc.config.reading import parsed

    try:
        read = parsed(str(table["description"][0]), "robot.parquet, description")[0].data["dh"]
        return [joint for joint, row in enumerate(read, 1) if row.get("joint") == "prismatic"]
    except (InputError, AttributeError, IndexError, KeyError, TypeError):
        return []  # no robot; that it is another one than the settings name is found elsewhere


RULES: tuple[tuple[tuple[str, ...], Rule], ...] = (
    (("measurements",), _unit_quaternions("measurements")),
    (("measurements",), _measurements),
    *(
        rule
        for kind in FITTED
        if kind != PLAINEST
        for rule in (
            ((f"{kind}_frames",), _unit_quaternions(f"{kind}_frames")),
            ((f"{kind}_frames", "measurements"), _frames(f"{kind}_frames", (kind,))),
            ((f"{kind}_frames", "frames"), _frames_kept(kind)),
        )
    ),
    (("frames",), _unit_quaternions("frames")),
    (("frames", "measurements"), _frames("frames", (*ALWAYS, NOMINAL))),
    (("vec_model",), _vec_model),
    *(((f"{kind}_model", "measurements"), _every_joint(f"{kind}_model")) for kind in FITTED),
    (("measurements", "robot"), _turns("measurements", ())),
    (("assessment_points", "robot"), _turns("assessment_points", ())),
    (("accuracy_map", "robot"), _turns("accuracy_map", ())),
    (("vec_model", "robot"), _turns("vec_model", ("q_min_rad", "q_max_rad"))),
    (("joint_bias", "robot"), _turns("joint_bias", ("from_rad", "to_rad"))),
    (("pose_errors", "measurements"), _pose_errors),
    (("residuals",), _residuals),
    (("residuals", "pose_errors"), _residuals_told),
)
