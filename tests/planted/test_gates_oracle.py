"""Figures of gates by sorted lists and other libraries, and chance by resampling by hand."""

from __future__ import annotations

import math

import judged
import pyarrow.parquet as pq
import pytest
import yaml
from oracles import gates as oracle
from worlds import World

MODELS = {"dh": "dh_vs_measured", "vec": "vec_vs_measured", "nominal": "nominal_vs_measured"}
AXES = {
    "position": ("ex_mm", "ey_mm", "ez_mm", "mm"),
    "orientation": ("rx_mrad", "ry_mrad", "rz_mrad", "mrad"),
}
HELD_OUT = {"held_out": "cross_validated", "training": "train"}


def sizes(world: World, dataset: str, model: str, at: str, quantity: str) -> list[float]:
    """Magnitudes of the errors that a gate is about."""
    *axes, _ = AXES[quantity]
    rows = pq.read_table(world.results / dataset / "pose_errors.parquet").to_pylist()
    return [
        math.sqrt(math.fsum(row[axis] ** 2 for axis in axes))
        for row in rows
        if row["comparison"] == MODELS[model] and row["estimate"] == HELD_OUT[at]
    ]


def outcomes(world: World, gates: list[dict]) -> dict[tuple[str, str], dict]:
    """What became of gates, by data set and name."""
    settings = yaml.safe_load(world.configs[1].read_text()) | {"gates": gates}
    world.configs[1].write_text(yaml.safe_dump(settings))
    told = judged.mappings(world.gate().told)
    names = {each["name"] for each in gates}
    return {
        (each["dataset"], each["name"]): each
        for each in told
        if "verdict" in each and each.get("name") in names
    }


CASES = [
    ("position", "vec", "training"),
    ("orientation", "dh", "held_out"),
]


@pytest.mark.parametrize(("quantity", "model", "at"), CASES)
def test_figures_of_errors_are_what_sorted_lists_say(world, quantity, model, at):
    unit = AXES[quantity][-1]
    right = {
        dataset: oracle.statistics(sizes(world, dataset, model, at, quantity))
        for dataset in ("own", "mh180")
    }
    gates, wanted = [], {}
    for statistic, value in right["own"].items():
        for word, limit in (("above", value * (1 + 1e-6)), ("below", value * (1 - 1e-6))):
            gates.append(
                {
                    "name": f"{statistic} {word}",
                    "value": f"residuals.{quantity}.{statistic}",
                    "model": model,
                    "at": at,
                    f"at_most_{unit}": limit,
                }
            )
            wanted["own", f"{statistic} {word}"] = "passed" if word == "above" else "failed"
    found = outcomes(world, gates)
    for (dataset, name), each in found.items():
        value = right[dataset][name.split()[0]]
        assert each["figures"][f"value_{unit}"] == pytest.approx(value, rel=1e-6), name
    for key, verdict in wanted.items():
        if key[1] != "p99 above":  # of 39 rows nobody can tell what one in a hundred is
            assert found[key]["verdict"] == verdict, found[key]


def test_percentiles_say_whether_they_are_empirical_or_of_a_distribution(world):
    gates = [
        {"name": name, "value": f"residuals.position.{name}", "at_most_mm": 100.0}
        for name in ("p99", "p99_gamma")
    ]
    found = outcomes(world, gates)
    for dataset in ("own", "mh180"):
        assert "empirical" in found[dataset, "p99"]["says"]
        assert "gamma" in found[dataset, "p99_gamma"]["says"]
        assert "empirical" not in found[dataset, "p99_gamma"]["says"]
