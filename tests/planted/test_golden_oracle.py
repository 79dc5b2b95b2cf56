"""Two runs that differ by a known amount in one known place, and what the gate says of it."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import tampered
from worlds import World

from kinacc.artifacts import store
from kinacc.gate import golden
from kinacc.gate.outcome import Difference


def changed(world: World, dataset: str, artefact: str, change, renewed: bool = True) -> None:
    """Change the columns of a table, given by name as lists, and renew every digest."""
    table = pq.read_table(world.results / dataset / f"{artefact}.parquet")
    columns = change(table.to_pydict())
    new = pa.table(
        {name: pa.array(values, table.schema.field(name).type) for name, values in columns.items()},
        schema=pa.schema([table.schema.field(name) for name in columns], table.schema.metadata),
    )
    tampered.write(world, dataset, artefact, new, renewed)


def compared(world: World, exact: bool = False) -> tuple[str, list[Difference]]:
    """The worst verdict on both data sets, and all differences that are named."""
    outcomes = golden.compared(world.results, world.accepted, ["mh180", "own"], exact)
    verdicts = {each.verdict for each in outcomes}
    found = [each for outcome in outcomes for each in outcome.differences]
    return (verdicts.pop() if len(verdicts) == 1 else "failed"), found


def plus(column: str, row: int, by: float):
    def change(columns: dict) -> dict:
        assert columns[column][row] is not None
        columns[column][row] += by
        return columns

    return change


# A millimetre and a milliradian are held to 1e-6 (as the issue says), a radian to 1e-9.
NUMBERS = [
    ("own", "pose_errors", "ex_mm", 1e-6),
    ("own", "pose_errors", "rz_mrad", 1e-6),
    ("own", "assessment_points", "true_error_mm", 1e-6),
    ("mh180", "accuracy_map", "q2", 1e-9),
    ("mh180", "accuracy_map", "position_max_mm", 1e-6),
    ("mh180", "study", "assessed_mm", 1e-6),
    ("mh180", "histories", "eta_mm", 1e-6),
]


@pytest.mark.parametrize(("dataset", "artefact", "column", "within"), NUMBERS)
@pytest.mark.parametrize(("times", "verdict"), [(0.5, "passed"), (3.0, "failed")])
def test_a_number_off_by_less_or_more_than_its_unit_allows(
    world, dataset, artefact, column, within, times, verdict
):
    values = pq.read_table(world.results / dataset / f"{artefact}.parquet")[column].to_pylist()
    row = next(number for number, value in enumerate(values) if value is not None and number > 1)
    changed(world, dataset, artefact, plus(column, row, times * within))
    said, found = compared(world)
    assert said == verdict, found
    if verdict == "failed":
        (one,) = [each for each in found if each.artefact == artefact]
        assert (one.dataset, one.column) == (dataset, column)
        assert one.rows == 1
        assert one.largest == pytest.approx(times * within, rel=0.05)
        assert [cause.kind for cause in one.causes] == ["unexplained"]
        assert {each.artefact for each in found} == {artefact}


def swapped_words(columns: dict) -> dict:
    columns["verdict"][0] = "differs" if columns["verdict"][0] == "agrees" else "agrees"
    return columns


def nulled(columns: dict) -> dict:
    row = next(i for i, value in enumerate(columns["position_max_mm"]) if value is not None)
    columns["position_max_mm"][row] = None
    return columns


def filled(columns: dict) -> dict:
    row = next(i for i, value in enumerate(columns["lower_mm"]) if value is None)
    columns["lower_mm"][row] = 0.5
    return columns


def without_a_row(columns: dict) -> dict:
    return {name: values[:3] + values[4:] for name, values in columns.items()}


def with_a_row_more(columns: dict) -> dict:
    columns = {name: [*values, values[-1]] for name, values in columns.items()}
    columns["height_mm"][-1] += 250.0
    return columns


@pytest.mark.parametrize(
    ("artefact", "change"),
    [
        ("claims", swapped_words),
        ("accuracy_map", plus("solutions", 3, 1)),
        ("accuracy_map", nulled),
        ("study", filled),
        ("accuracy_map", without_a_row),
        ("accuracy_map", with_a_row_more),
        ("study_summary", plus("repetitions", 0, 1)),
    ],
)
def test_words_whole_numbers_nulls_and_rows_are_held_to_be_equal(world, artefact, change):
    changed(world, "mh180", artefact, change)
    said, found = compared(world)
    assert said == "failed"
    assert {(each.dataset, each.artefact) for each in found} == {("mh180", artefact)}


def test_rows_in_another_order_are_matched_by_their_key(world):
    def shuffled(columns: dict) -> dict:
        order = np.random.default_rng(3).permutation(len(columns["row"])).tolist()
        return {name: [values[i] for i in order] for name, values in columns.items()}

    changed(world, "own", "pose_errors", shuffled)
    assert compared(world) == ("passed", [])


def along_first_axis(world: World, base_mm: float, d_mm: float) -> None:
    """Move the base along the first axis, and the first link along itself.

    By opposite amounts no pose changes: the measurements cannot tell one from the other.
    """

    def frames(columns: dict) -> dict:
        for row, (model, frame) in enumerate(zip(columns["model"], columns["frame"], strict=True)):
            if (model, frame) == ("dh", "base"):
                w, x, y, z = (columns[f"q{each}"][row] for each in "wxyz")
                axis = (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))
                for name, share in zip(("x_mm", "y_mm", "z_mm"), axis, strict=True):
                    columns[name][row] += base_mm * share
        return columns

    if base_mm:
        changed(world, "own", "frames", frames)
    if d_mm:
        changed(world, "own", "dh_model", plus("d_mm", 0, d_mm))


def test_parameters_that_the_poses_do_not_determine_may_be_others(world):
    along_first_axis(world, 0.5, -0.5)
    said, found = compared(world)
    assert said == "passed", found


@pytest.mark.parametrize(("base_mm", "d_mm"), [(0.001, 0.0), (0.0, 0.001), (0.001, 0.001)])
def test_parameters_that_predict_other_poses_are_told(world, base_mm, d_mm):
    along_first_axis(world, base_mm, d_mm)
    said, found = compared(world)
    assert said == "failed"
    assert {each.artefact for each in found} <= {"frames", "dh_model"}


def test_a_table_that_is_gone_and_one_that_is_new_are_named(world):
    (world.results / "mh180" / "claims.parquet").unlink()
    said, found = compared(world)
    assert said == "failed"
    assert ("mh180", "claims") in {(each.dataset, each.artefact) for each in found}


def test_bytes_are_compared_where_that_is_asked_for(world):
    path = world.results / "own" / "pose_errors.parquet"
    table = pq.read_table(path)
    more = {**table.schema.metadata, b"another": b"remark"}
    tampered.write(world, "own", "pose_errors", table.replace_schema_metadata(more), True)
    assert store.columns_digest(pq.read_table(path)) == store.columns_digest(table)
    assert compared(world) == ("passed", [])
    said, found = compared(world, exact=True)
    assert said == "failed"
    (one,) = found
    assert (one.dataset, one.artefact.removesuffix(".parquet")) == ("own", "pose_errors")
