"""The section on the study: what is stated beside the largest error, and how often too small."""

from __future__ import annotations

import made_up_study as made_up
import numpy as np
import pytest
from parsed import as_page, read

from kinacc.kinematics import robot
from kinacc.report import study
from kinacc.report.page import Part, Picture

ARM = robot.load("mh180")


def section_of(measured: bool = False, **stated) -> Part:
    return study.section({**made_up.points(measured), **made_up.study(**stated)}, ARM)


def pictures(section: Part) -> dict[str, Picture]:
    return {each.key: each for each in section.pictures}


def data_of(picture: Picture) -> dict[str, np.ndarray]:
    named = (each.data_source for each in picture.plot.renderers)
    return next(each for each in named if each.name).data


def test_the_true_error_of_a_synthetic_arm_is_called_known():
    section = section_of()
    assert "known exactly" in read(section).population
    assert "0.500 mm" in read(section).shows
    assert "true largest error" in read(section).captions["study-noise"]


def test_errors_of_measured_poses_are_only_taken_as_true():
    section = section_of(measured=True)
    assert "contain the instrument's noise" in read(section).population
    assert "taken as true" in read(section).captions["study-noise"]
    assert "true largest error" not in read(section).captions["study-noise"]


def test_models_of_a_measured_arm_are_only_taken_as_true():
    tables = {**made_up.points(), **made_up.study()}
    tables["measurements"]["row"] = np.arange(3.0)
    section = study.section(tables, ARM)
    assert "of models, not measured" in read(section).population
    assert "taken as true" in read(section).captions["study-noise"]


def test_each_method_has_its_error_and_how_often_it_is_too_small():
    (table,) = read(section_of()).tables
    assert table.rows[0] == (
        *("maximum measurement", "0.05", "0.650", "0.400", "0.900", "+0.150", "1 of 4"),
    )
    assert table.rows[2][-2:] == ("-0.075", "3 of 4")


def test_every_noise_can_be_chosen_and_every_simulation_is_there():
    picture = pictures(section_of())["study-runs"]
    (control,) = picture.controls
    assert [option.label for option in control.options] == ["50 µm", "300 µm"]
    assert control.options[0].sets == (("study-level", "group", 0),)
    data = data_of(picture)
    assert len(data["level"]) == 2 * 2 * 4
    assert data["less"].tolist() == pytest.approx(
        [value - made_up.LARGEST_MM for each in 2 * [*made_up.STATED_MM.values()] for value in each]
    )


def test_simulations_of_a_long_study_are_drawn_in_part(monkeypatch):
    monkeypatch.setattr(study, "_MOST_RUNS", 8)
    data = data_of(pictures(section_of())["study-runs"])
    assert set(data["repetition"]) == {0, 2}
    assert len(data["level"]) == 8


def test_an_assessor_of_ones_own_is_shown_beside_the_papers():
    section = section_of(stated={"maximum": (0.4,) * 4, "my_own": (0.6,) * 4})
    assert data_of(pictures(section)["study-runs"])["assessor"].max() == 1
    assert pictures(section)["study-runs"].names["assessor"] == ("maximum measurement", "my own")


def test_a_study_of_which_only_the_summary_is_left_is_shown_by_it():
    tables = {**made_up.points(), **made_up.study()}
    del tables["study"]
    assert list(pictures(study.section(tables, ARM))) == ["study-noise"]


def test_the_same_study_makes_the_same_bytes():
    one, other = (as_page(section_of()) for _ in range(2))
    assert one == other
