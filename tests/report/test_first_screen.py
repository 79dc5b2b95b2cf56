"""What someone who never saw the tool reads first: how good, how sure, what next."""

import re

import pytest

from kinacc.calibration.summary import Fact
from kinacc.report import first_screen, page
from kinacc.report.first_screen import Answers

NOTHING = Answers({}, [], [], (), [], [], "kinacc fitted results/cell --all")


def errors(topic, **by_model):
    names = ("n", "mean", "quantile_99", "largest")
    return [
        Fact(topic, model, name, float(value), "mm")
        for model, values in by_model.items()
        for name, value in zip(names, values, strict=True)
    ]


def facts(*more, source="file", selected="vec", held_out=True):
    table = {
        "nominal": (1495, 1.031, 1.88, 2.14),
        "dh": (1495, 0.402, 0.93, 2.05),
        "vec": (1495, 0.241, 0.712, 2.11),
    }
    return [
        Fact("robot", "ur10", "name", text="ur10"),
        Fact("robot", "base and tool", "fitted", 1.0, "1"),
        Fact("data", "measurements", "source", text=source),
        *(
            Fact("data", "measurements", name, float(n), "1")
            for name, n in {"readings": 1495, "poses": 1495, "targets": 1, "fitted": 1495}.items()
        ),
        *errors("held_out_error" if held_out else "training_error", **table),
        *(
            Fact("selection", model, name, value, "1")
            for model in ("dh", "vec")
            for name, value in {
                "selected": float(model == selected),
                "gain": 0.07 * (model == "vec"),
                "gain_std_error": 0.004,
            }.items()
        ),
        *more,
    ]


def words(found, answers=NOTHING, remedies=(), name="cell"):
    screen = first_screen.screen(name, "ur10", found, remedies, answers)
    text = page.html(page.Page(screen, ()), {}, {"summary": "0" * 64})
    shown = text[text.index("<header>") : text.index("<nav")]
    shown = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", shown))
    for mark, character in {"&gt;": ">", "&lt;": "<", "&#34;": '"', "&amp;": "&"}.items():
        shown = shown.replace(mark, character)
    return shown


def test_how_good_how_sure_and_what_next_without_a_campaign():
    shown = words(
        facts(),
        Answers({}, [], ["a campaign bounds it:", "kinacc campaign start c"], (),
                ["kinacc export results/cell"], [], ""),
        ["line 534: measure it again"],
    )  # fmt: skip
    for told in (
        "calibrated model (VEC) at held-out poses: 0.24 mm; 99% are below 0.71 mm.",
        "Nominal model, with the best base and tool: 1.03 mm on average.",
        "Observed on 1495 rows, each left out of the fit in turn.",
        "not assessed (no campaign); the largest observed is 2.11 mm.",
        "Tolerance: none set.",
    ):
        assert told in shown
    assert "confidence" not in shown
    order = ("first, line 534: measure it again", "kinacc campaign start c", "kinacc export")
    assert sorted(order, key=shown.index) == list(order)


def test_figures_of_all_models_stand_on_the_same_rows():
    shown = words(facts())
    assert "the same 1495 rows for every model" in shown
    assert "nominal, with base and tool fitted 1.03 1.88 2.14" in shown
    assert "DH 0.40 0.93 2.05" in shown
    assert "VEC 0.24 0.71 2.11 selected" in shown


def test_a_confidence_stands_there_only_from_a_campaign():
    statement = "The largest error of all 200 candidates is at most 0.964 mm with 95% confidence."
    said = (statement, "Tolerance 1 mm: accept.")
    shown = words(facts(), Answers({}, [], ["campaign check"], said, [], [], ""))
    assert shown.index("Observed on 1495 rows") < shown.index(statement)
    assert "Tolerance 1 mm: accept." in shown
    assert "own poses: the largest error among the 1495 rows is 2.11 mm" in shown
    assert "not assessed" not in shown
    assert "none set" not in shown


def test_no_pose_was_held_out():
    shown = words(facts(held_out=False))
    assert "at the fitted poses: 0.24 mm" in shown
    assert "No pose was held out: errors at other poses are larger, and unknown." in shown
    assert "at held-out poses:" not in shown


def test_small_errors_keep_two_digits():
    small = {
        "nominal": (20, 1.5, 2.0, 2.1),
        "dh": (20, 0.1, 0.2, 0.3),
        "vec": (20, 0.067, 0.1, 0.132),
    }
    found = [each for each in facts() if each.topic != "held_out_error"]
    shown = words([*found, *errors("held_out_error", **small)])
    assert "at held-out poses: 0.067 mm" in shown
    assert "VEC 0.067 0.100 0.132" in shown


@pytest.mark.parametrize(
    ("more", "badge"),
    [
        ([], "DATA: not checked"),
        ([Fact("check", "data_check", "findings", 0.0, "1")], "DATA: nothing suspicious"),
        (
            [Fact("check", "few_poses", "note", 0.0, "1", "few_poses: few")],
            "DATA: nothing suspicious",
        ),
        ([Fact("check", "outliers", "warning", 3.0, "1", "outliers: 3 rows")], "DATA: 1 problem"),
        (
            [Fact("check", "outliers", "stops", 3.0, "1", "outliers: 3 rows; accepted: a test")],
            "DATA: 1 problem, accepted",
        ),
    ],
)
def test_whether_the_data_are_in_doubt(more, badge):
    assert badge in words(facts(*more))


def test_a_synthetic_arm_is_called_one():
    shown = words(facts(source="synthetic"))
    assert "SYNTHETIC ARM" in shown
    assert "of a synthetic arm: no measurement" in shown


def test_tables_of_an_earlier_run_are_named_and_not_shown():
    left_out = Answers({}, [], [], (), [], ["accuracy_map", "claims"], "")
    assert "accuracy_map, claims: made from other tables than those here" in words(
        facts(), left_out
    )


def test_a_name_that_looks_like_markup_is_a_name():
    screen = first_screen.screen("<b onclick='x'>&", "ur10", facts(), (), NOTHING)
    text = page.html(page.Page(screen, ()), {}, {"summary": "0" * 64})
    assert "<b onclick" not in text
    assert "&lt;b onclick=&#39;x&#39;&gt;&amp;" in text
