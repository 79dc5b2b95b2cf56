"""What the golden results are made of: data sets, faults, exports, a campaign.

Shared by the tests beside it and by ``tools/renew_golden.py``, which makes the files.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

TESTS = Path(__file__).parents[1]
sys.path[:0] = [str(TESTS), *(str(TESTS / name) for name in ("checks", "cli", "campaign"))]

import plants  # noqa: E402
from command_line import answer  # noqa: E402
from good_files import File, simulated  # noqa: E402
from stages_by_hand import STAGES, tables_in  # noqa: E402

from kinacc.campaign import folder as campaigns  # noqa: E402
from kinacc.campaign.state import unplanned_mm2  # noqa: E402
from kinacc.study import monte_carlo  # noqa: E402
from kinacc.tables import store  # noqa: E402
from kinacc.workflow.data_sets import DataSets, read_data_sets  # noqa: E402

GOLDEN = Path(__file__).parent
ROOT = GOLDEN.parents[1]
RESULTS = GOLDEN / "results"
MARKS = {"kinacc_version": "golden", "config_hash": "golden", "seed": "0"}
CALIBRATION = ("measurements", "vec", "dh", "residuals", "summary")
PAPER = (
    *CALIBRATION,
    "accuracy_map",
    "assessment_points",
    "study_chunk",
    "study",
    "histories",
    "claims",
)
DATA_SETS = {
    "mh180": PAPER,
    "ur10_d": CALIBRATION,
    "ur5_grid": CALIBRATION,
    "spherical_wrist": CALIBRATION,
    "ur_type": CALIBRATION,
    "seven_axes": CALIBRATION,
}
_SIMULATED = {"spherical_wrist": "irb120", "ur_type": "ur10", "seven_axes": "iiwa14"}


def data_sets() -> DataSets:
    """Settings of all golden data sets; paths in them are relative to the repository."""
    return read_data_sets([GOLDEN / "config.yaml"])


def write_simulated_files() -> None:
    """Measured files of simulated arms, half a millimetre and a milliradian off, and the truth."""
    (GOLDEN / "data").mkdir(exist_ok=True)
    for name, robot in _SIMULATED.items():
        file = simulated(robot, poses=100, noise_mm=0.02, turned=True, seed=4)
        file.write(GOLDEN / "data", name).unlink()


def run_stage(
    data: DataSets, dataset: str, stage: str, folder: Path, **other: object
) -> dict[str, Mapping]:
    """Tables that one stage makes of the tables in a folder, with ``other`` settings."""
    run = {**STAGES, "study_chunk": monte_carlo.simulated}[stage]
    return run(tables_in(folder), {**data.settings[dataset], **other})


def write_tables(tables: Mapping[str, Mapping], folder: Path) -> None:
    """Tables of a stage as files, without what differs from version to version."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, columns in tables.items():
        (folder / f"{name}.parquet").write_bytes(
            store.content_of(store.to_table(name, columns, MARKS))
        )


def faults() -> Iterator[tuple[str, File]]:
    """Files of a simulated arm with one fault each."""
    good = simulated("irb120", poses=60, turned=True, seed=2)
    every, some, late = plants.every(good), plants.some(good), plants.late(good)
    yield "none", good
    yield "joints_in_radians", plants.joints_in_radians(good, every)
    yield "some_joints_in_radians", plants.joints_in_radians(good, some)
    yield "metres", plants.in_metres(good, every)
    yield "left_handed", plants.mirrored(good, every)
    yield "transposed", plants.transposed(good, every)
    yield "angles_in_radians", plants.angles_in_radians(good, every)
    for joint in (2, 4, 6):
        yield f"sign_of_joint_{joint}", plants.reversed_joint(good, every, joint)
    yield "coupled_joints", plants.coupled(good, every)
    columns = {"q4_deg": good.columns["q5_deg"], "q5_deg": good.columns["q4_deg"]}
    yield "joints_exchanged", good.but(**columns)
    yield "rows_twice", plants.copied(good, some)[0]
    yield "outliers", plants.shifted(good, plants.points(good), (15.0, -9.0, 12.0), some)
    yield "base_jump", plants.jumped(good, late)
    yield "tool_moved", plants.on_the_flange(good, plants.rotations(good), (0.5, -0.5, 0.4), late)
    yield "commanded_joints", plants.rounded(good, every)


def findings(folder: Path, name: str) -> list[dict]:
    """Codes, levels, lines and numbers that ``check-data`` finds in a configured file."""
    told = answer("check-data", folder / f"{name}.yaml", code=None)
    kept = ("kind", "level", "lines")
    found = []
    for each in told.get("datasets", [{}])[0].get("suspicions", []):
        numbers = {key: value for key, value in each.items() if _is_number(value)}
        found.append({**{key: each[key] for key in kept}, **numbers})
    return found


def _is_number(value: object) -> bool:
    values = value if isinstance(value, list) else [value]
    return bool(values) and all(isinstance(each, float) for each in values)


def campaign_course() -> dict:
    """Points asked for, statements after every reading and limits of points of the campaign."""
    course = []
    state = campaigns.open_(GOLDEN / "campaign").state
    campaign = state.plan.assessor.begin(state.plan.candidates(state.rows))
    for item in state.used:
        unplanned = unplanned_mm2(state.plan, item.reading)
        campaign.record(campaign.next(), item.error_mm, unplanned)
        said = [
            {
                "target": each.target,
                "withheld": each.withheld.code if each.withheld else "",
                "excepted": each.excepted,
                "mm": [each.value_mm, each.lower_mm, each.upper_mm],
            }
            for each in campaign.statements()
        ]
        course.append({"said": said, "reading": item.number, "point": item.reading.point})
    limits = {str(row): list(each) for row, each in state.campaign.point_limits().items()}
    return {"course": course, "limits_mm": limits, "struck": [e.number for e in state.struck]}
