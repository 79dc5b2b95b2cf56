"""Gates as people write them into a configuration, right and wrong."""

import pytest
from complaints import complaints

from kinacc.checks.configuration import load

END = "datasets: {mh180: {robot: mh180}, other: {robot: mh180}}\n"


def test_every_mistake_in_gates_is_told_at_once_with_its_place_and_what_is_meant(tmp_path):
    path = tmp_path / "cell.yaml"
    path.write_text(
        """gates:
- {name: a, value: residual.position.p99, at_most_mm: 0.8}
- {name: b, value: residuals.position.p99, at_most_mrad: 0.8}
- {name: c, value: data.poses, against: accepted, allow_mm: 0.02}
- {name: d, campain: checks/march}
- {name: e, claims: agree, suspicions: none}
- {value: data.poses, at_least: 3}
- {name: g, suspicions: none, on_fial: warn}
- {name: h, value: residuals.position.p99, at_most_mm: 1, at_most_mrad: 2}
- {name: i, value: residuals.position.mean, against: accepted}
- 7
"""
        + END
    )
    told = complaints(path, folder=tmp_path)
    wanted = [
        (":2, gates[0].value", "did you mean residuals.position.p99?"),
        (":3, gates[1]", "give at_most_mm"),
        (":4, gates[2].value", "'data.poses' should be"),
        (":5, gates[3]", "campaign"),
        (":6, gates[4]", "is not of one kind"),
        (":7, gates[5]", "has no name"),
        (":8, gates[6].on_fial", "did you mean on_fail?"),
        (":9, gates[7]", "give at_most_mm"),
        (":10, gates[8]", "has no allowance"),
        (":11, gates[9]", "7 is not of one kind"),
    ]
    assert len(told) == len(wanted)
    for one, (place, words) in zip(told, wanted, strict=True):
        assert place in one
        assert words in one


@pytest.mark.parametrize(
    ("tolerance", "gate", "fits"),
    [
        ("{mm: 0.8, of: quantile_99}", "value: residuals.position.p99", True),
        ("{mm: 0.8, of: mean}", "value: residuals.position.mean", True),
        ("{mm: 0.8}", "campaign: check", True),
        ("{mm: 0.8, of: mean}", "value: residuals.position.p99", False),
        ("{mm: 0.8, of: quantile_99}", "value: residuals.position.p99_gamma", False),
        ("{mm: 0.8, of: mean}", "campaign: check", False),
        ("{of: mean}", "value: residuals.position.mean", False),
    ],
)
def test_a_gate_without_a_limit_has_that_of_the_tolerance_if_it_is_of_the_same(
    tmp_path, tolerance, gate, fits
):
    path = tmp_path / "cell.yaml"
    path.write_text(f"tolerance: {tolerance}\ngates: [{{name: a, {gate}}}]\n{END}")
    if fits:
        assert len(load([path], folder=tmp_path)["mh180"]["gates"]) == 1
    else:
        (told,) = complaints(path, folder=tmp_path)
        assert "gates[0]" in told
