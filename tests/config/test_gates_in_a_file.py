"""Gates as people write them into a configuration, right and wrong."""

import pytest

from kinacc.config.gate_rules import FIGURES
from kinacc.config.load import load
from kinacc.errors import InputError
from kinacc.gate import values
from kinacc.gate.values import RunTables

END = "datasets: {mh180: {robot: mh180}, other: {robot: mh180}}\n"


def loaded(tmp_path, text, end=END):
    path = tmp_path / "cell.yaml"
    path.write_text(text + end)
    return load([path], folder=tmp_path)


def problems(tmp_path, text, end=END):
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, text, end)
    return [str(each) for each in caught.value.problems]


def test_the_gates_of_the_issue_are_read_with_what_they_leave_open(tmp_path):
    gates = loaded(
        tmp_path,
        """gates:
- {name: held out, value: residuals.position.p99, model: selected, at_most_mm: 0.8}
- {name: not worse, value: residuals.position.mean, against: accepted, allow_mm: 0.02}
- {name: acceptance, campaign: checks/march, tolerance_mm: 1.0, undecided: warn}
- {name: paper, claims: agree, except: [map_nonlinear]}
- {name: data, suspicions: none, on_fail: warn, datasets: [other]}
""",
    )
    own = gates["mh180"]["gates"]
    assert [each["kind"] for each in own] == ["value", "against", "campaign", "claims"]
    assert own[0]["at"] == "held_out"
    assert own[0]["undecided"] == "fail"
    assert own[1]["beyond_chance"] == 0.99
    assert [each["name"] for each in gates["other"]["gates"]][-1] == "data"


def test_every_mistake_in_gates_is_told_at_once_with_its_place_and_what_is_meant(tmp_path):
    told = problems(
        tmp_path,
        """gates:
- {name: a, value: residual.position.p99, at_most_mm: 0.8}
- {name: b, value: residuals.position.p99, at_most_mrad: 0.8}
- {name: c, value: bound.upper, against: accepted, allow_mm: 0.02}
- {name: d, campain: checks/march}
- {name: e, claims: agree, suspicions: none}
- {value: data.poses, at_least: 3}
- {name: g, suspicions: none, on_fial: warn}
- {name: h, value: residuals.position.p99, at_most_mm: 1, at_least_mm: 2}
- {name: i, value: residuals.position.mean, against: accepted}
- 7
""",
    )
    wanted = [
        (":2, gates[0].value", "did you mean residuals.position.p99?"),
        (":3, gates[1]", "in mm"),
        (":4, gates[2]", "chance cannot be told of bound.upper"),
        (":5, gates[3]", "did you mean campaign?"),
        (":6, gates[4]", "is not of one kind"),
        (":7, gates[5]", "has no name"),
        (":8, gates[6].on_fial", "did you mean on_fail?"),
        (":9, gates[7]", "give one of"),
        (":10, gates[8]", "give one of allow_mm"),
        (":11, gates[9]", "7 is not of one kind"),
    ]
    assert len(told) == len(wanted)
    for one, (place, words) in zip(told, wanted, strict=True):
        assert place in one
        assert words in one


def test_a_gate_about_a_data_set_that_is_not_there_is_refused(tmp_path):
    (told,) = problems(tmp_path, "gates: [{name: a, history: holds, datasets: [mh18]}]\n")
    assert "names mh18" in told
    assert "mh180, other" in told


def test_a_gate_inside_of_a_data_set_names_no_data_sets(tmp_path):
    end = "datasets:\n  mh180:\n    robot: mh180\n    gates:\n"
    end += "    - {name: a, history: holds, datasets: [mh180]}\n"
    (told,) = problems(tmp_path, "", end)
    assert "cell.yaml:4, datasets.mh180.gates" in told


@pytest.mark.parametrize(
    ("tolerance", "gate", "fits"),
    [
        ("{mm: 0.8, of: quantile_99}", "value: residuals.position.p99", True),
        ("{mm: 0.8, of: mean}", "value: residuals.position.mean", True),
        ("{mm: 0.8}", "value: bound.upper", True),
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
    text = f"tolerance: {tolerance}\ngates: [{{name: a, {gate}}}]\n"
    if fits:
        assert len(loaded(tmp_path, text)["mh180"]["gates"]) == 1
    else:
        (told,) = problems(tmp_path, text)
        assert "gates[0]" in told


def test_campaigns_are_sought_from_the_folder_of_the_configuration(tmp_path):
    (tmp_path / "cell").mkdir()
    path = tmp_path / "cell" / "cell.yaml"
    path.write_text("gates: [{name: a, campaign: check, tolerance_mm: 1}]\n" + END)
    assert load([path], folder=tmp_path)["mh180"]["gates"][0]["campaign"] == "cell/check"


def test_every_figure_of_the_schema_can_be_asked_for(tmp_path):
    gate = {"model": "dh", "at": "held_out"}
    for name in FIGURES:
        with pytest.raises(InputError, match=r"missing|no such file|no calibration"):
            values.figure(name, RunTables(tmp_path), gate)
