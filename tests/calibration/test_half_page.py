"""The half page about a calibration: each sentence from facts made up for it."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.calibration.summary import Fact
from kinacc.calibration.summary_words import half_page, paragraph, selected, texts_of

MORE = "kinacc fitted results/a --all"
SIZES = ("n", "mean", "quantile_99", "largest")


def held_out(model, n=40, mean=0.1, most=0.4, topic="held_out_error"):
    values = (n, mean, 0.9 * most, most)
    return [
        Fact(topic, model, name, value, "mm") for name, value in zip(SIZES, values, strict=True)
    ]


def chosen(model, is_selected, gain, error, **order):
    values = {"selected": is_selected, "gain": gain, "gain_std_error": error, **order}
    return [Fact("selection", model, name, float(value)) for name, value in values.items()]


def why(*facts):
    return " ".join(selected([*facts, *held_out("nominal", mean=9.0), *held_out("dh"),
                              *held_out("vec")])).replace("\u00a0", " ")  # fmt: skip


def test_a_better_model_is_selected_by_its_gain_and_how_sure_that_is():
    assert why(*chosen("dh", 0, 0.0, 0.0), *chosen("vec", 1, 0.0123, 0.004)) == (
        "VEC is selected: on held-out poses its squared error is lower by 0.012 +- 0.004 mm^2 than "
        "that of DH, more than two standard errors"
    )


def test_small_gains_keep_their_digits():
    text = why(*chosen("dh", 0, 0.0, 0.0), *chosen("vec", 1, 0.000123, 0.00004))
    assert "lower by 0.00012 +- 4e-05 mm^2" in text
    assert "lower by 0.001 +- 0.001 mm^2" in why(
        *chosen("dh", 0, 0.0, 0.0), *chosen("vec", 1, 0.001, 0.001)
    )


def test_the_plainest_model_stays_where_the_gain_is_not_sure():
    text = why(*chosen("dh", 1, 0.0, 0.0), *chosen("vec", 0, 0.01, 0.008))
    assert text == (
        "DH is selected: with VEC the squared error of held-out poses is lower by 0.010 +- 0.008 "
        "mm^2, no more than two standard errors"
    )
    at_most = why(*chosen("dh", 1, 0.0, 0.0), *chosen("vec", 0, 0.016, 0.008))
    assert at_most.endswith("no more than two standard errors")
    sure = why(*chosen("dh", 1, 0.0, 0.0), *chosen("vec", 0, 0.017, 0.008))
    assert sure.endswith("mm^2, but its rms over all rows or over folds is not")
    worse = why(*chosen("dh", 1, 0.0, 0.0), *chosen("vec", 0, -0.02, np.nan))
    assert worse.endswith("held-out poses is higher by 0.020 mm^2")


def test_several_others_are_told_one_by_one_or_as_no_better():
    worse = [*chosen("vec", 0, -0.5, 0.1), *chosen("compliance", 0, -0.25, 0.1)]
    text = why(*chosen("dh", 1, 0.0, 0.0), *worse)
    assert text == (
        "DH is selected: with VEC the squared error of held-out poses is higher by 0.500 +- 0.100 "
        "mm^2; with compliance it is higher by 0.250 +- 0.100 mm^2"
    )
    best = why(*chosen("dh", 0, 0.0, 0.0), *chosen("vec", 1, 0.5, 0.1),
               *chosen("compliance", 0, 0.4, 0.1))  # fmt: skip
    assert best.endswith("more than two standard errors; no other model has less")


def test_one_model_alone_and_models_nothing_was_held_out_for():
    assert why(*chosen("dh", 1, 0.0, 0.0)) == "DH is the only model"
    text = why(*chosen("dh", 1, 0.0, np.nan), *chosen("vec", 0, np.nan, np.nan))
    assert text == "DH is selected: no pose was held out to judge VEC by"


@pytest.mark.parametrize(("mean", "warned"), [(0.099, True), (0.1, True), (0.101, False)])
def test_a_model_no_nearer_than_the_nominal_one_is_warned_of(mean, warned):
    facts = [*chosen("dh", 1, 0.0, 0.0), *held_out("nominal", mean=mean), *held_out("dh")]
    told = selected(facts)
    assert len(told) == 1 + warned
    assert not warned or told[1] == (
        "DH is no nearer to held-out poses than the nominal model is: measure more poses, or "
        "correct the data"
    )


def page(*facts, whole=False):
    data = {"readings": 40, "poses": 20, "targets": 2, "fitted": 40}
    every = [
        Fact("robot", "ur10", "name", text="ur10"),
        Fact("robot", "base and tool", "fitted", 1.0),
        Fact("data", "measurements", "source", text="file"),
        *(Fact("data", "measurements", name, float(n)) for name, n in data.items()),
        *chosen("dh", 1, 0.0, 0.0),
        *facts,
    ]
    return half_page(every, MORE, whole), texts_of(every, MORE, whole)


def test_the_data_are_counted_and_rows_held_out_told():
    _, texts = page()
    assert texts["data"] == ["40 readings of 2 targets at 20 poses: ur10, a measured arm"]
    _, texts = page(
        Fact("data", "measurements", "fitted", 30.0), *held_out("nominal"), *held_out("dh")
    )
    assert texts["data"][1:] == [
        "positions only: how the tool is turned is judged nowhere on this page",
        "models fitted to 30 of them, 10 held out (measurements.validation_fold)",
    ]
    _, texts = page(*(Fact("data", "measurements", name, 1.0) for name in ("poses", "targets")))
    assert texts["data"] == ["40 readings of 1 target at 1 pose: ur10, a measured arm"]


def test_suspicions_come_before_notes_and_three_of_them_with_where_the_others_are():
    doubts = [Fact("check", f"d{i}", "warning", 1.0, text=f"d{i}: row {i}") for i in range(3)]
    note = Fact("check", "sparse", "note", 0.0, text="sparse: few poses")
    _, texts = page(note, *doubts[:1])
    assert texts["check"] == ["d0: row 0", "note: few poses"]
    _, texts = page(note, *doubts)
    assert texts["check"] == ["d0: row 0", "d1: row 1", "d2: row 2", f"and 1 more: {MORE}"]
    _, texts = page(note, *doubts, whole=True)
    assert texts["check"] == ["d0: row 0", "d1: row 1", "d2: row 2", "note: few poses"]
    _, texts = page(note)
    assert texts["check"] == ["nothing suspicious", "note: few poses"]


def test_long_findings_are_fewer_so_that_they_take_five_lines_at_most():
    words = " ".join(["finding"] * 30)  # 239 letters: three lines of 83
    doubts = [Fact("check", f"d{i}", "warning", 1.0, text=words) for i in range(3)]
    _, texts = page(*doubts)
    assert texts["check"] == [words, f"and 2 more: {MORE}"]
    shorter = " ".join(["finding"] * 20)  # 159 letters: two lines
    doubts = [Fact("check", f"d{i}", "warning", 1.0, text=shorter) for i in range(3)]
    _, texts = page(*doubts)
    assert texts["check"] == [shorter, shorter, f"and 1 more: {MORE}"]


def test_excluded_rows_have_their_error_where_there_is_one():
    _, texts = page(
        Fact("excluded_rows", "row 7", "error", 1.23456, "mm", "doubled"),
        Fact("excluded_rows", "row 9", "error", np.nan, None, "no position"),
    )
    assert texts["excluded"] == ["row 7, 1.235 mm: doubled", "row 9: no position"]


def test_errors_of_each_model_stand_in_columns_and_the_selected_one_is_marked():
    lines, _ = page(*held_out("nominal", mean=2.5, most=5.0), *held_out("dh"))
    at = next(i for i, line in enumerate(lines) if line.startswith("held-out error"))
    head, nominal, dh = lines[at : at + 3]
    assert head.startswith("held-out error, mm (poses left out of the fit; 40 rows)")
    assert head.split()[-4:] == ["mean", "99%", "empirical", "largest"]
    assert nominal.split() == ["nominal,", "with", "base", "and", "tool", "fitted",
                               "2.500", "4.500", "5.000"]  # fmt: skip
    assert dh.split() == ["DH", "0.100", "0.360", "0.400", "<-", "selected"]
    ends = [line.index(number) + 5 for line, number in ((nominal, "2.500"), (dh, "0.100"))]
    assert ends == [head.index("mean") + 4] * 2
    assert all(len(line) <= 100 for line in lines)


def test_errors_of_training_are_told_where_nothing_was_held_out_or_everything_is_asked_for():
    trained = held_out("dh", topic="training_error")
    assert any(line.startswith("training error") for line in page(*trained)[0])
    both = [*trained, *held_out("nominal"), *held_out("dh")]
    assert not any(line.startswith("training error") for line in page(*both)[0])
    assert any(line.startswith("training error") for line in page(*both, whole=True)[0])


def orders(order, low, high, tried=None, by=None):
    facts = [Fact("selection", "vec", "order", float(order)),
             Fact("selection", "vec", "low_order_held_out", float(low)),
             Fact("selection", "vec", "high_order_held_out", float(high))]  # fmt: skip
    if tried:
        facts += [Fact("selection", "vec", "highest_order_tried", float(tried)),
                  Fact("selection", "vec", "configurations", 25.0),
                  Fact("selection", "vec", "highest_order_set_by", text=by)]  # fmt: skip
    lines, _ = page(
        *chosen("vec", 0, 0.1, 0.1), *facts, *held_out("nominal"), *held_out("dh"), *held_out("vec")
    )
    line = next(line for line in lines if line.strip().startswith("VEC, order"))
    return line.partition(" 0.")[0].strip()


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((3, 3, 3), "VEC, order 3"),
        ((3, 2, 4), "VEC, order 3 (held out: 2 to 4)"),
        ((3, 3, 3, 5, "settings"), "VEC, order 3"),
        ((5, 5, 5, 5, "settings"), "VEC, order 5, the highest allowed (vec.order_highest)"),
        ((5, 5, 5, 5, "configurations"), "VEC, order 5, the highest 25 configurations carry"),
        ((5, 4, 5, 5, "settings"), "VEC, order 5 (held out: 4 to 5), the most allowed"),
        ((5, 4, 5, 5, "configurations"), "VEC, order 5 (held out: 4 to 5), all the data carry"),
    ],
)
def test_the_order_says_what_set_it(given, told):
    assert orders(*given) == told


def test_what_bends_and_what_of_it_cannot_be_told():
    soft, lever = "compliance_rad_per_nm", "lever_coefficient_rad_per_mm"
    known = [
        Fact("bending", "joint 2", soft, 1.5e-6),
        Fact("bending", "joint 2", f"std_{soft}", 2e-8),
    ]
    _, texts = page(*known)
    assert texts["bending"] == ["joint 2: 1.5 +- 0.02 urad per N m"]
    product = [Fact("bending", "joint 3", lever, 2e-6)]
    _, texts = page(*product)
    assert texts["bending"] == [
        "joint 3: 2 (not determined) urad per mm of lever",
        "masses are not stated: of joint 3 only the product of weight and compliance can be seen, "
        "and for the payload that was measured",
    ]
    _, texts = page(*known, *product)
    assert texts["bending"][-1].endswith("can be seen of the arm's own weight")


def ranges(count, share=None):
    facts = [Fact("range", f"joint {j + 1}", name, value, unit)
             for j in range(count)
             for name, value, unit in (("low", -90.4, "deg"), ("high", 45.6, "deg"),
                                       ("share", 0.378, "1"))]  # fmt: skip
    if share is not None:
        facts.append(Fact("like_measured", "ranges of all joints", "share", share))
    return [text.replace("\u00a0", " ") for text in page(*facts)[1]["valid where"]]


def test_where_a_calibration_holds_is_told_three_joints_a_line():
    head, *lines = ranges(4)
    assert head == "near the measured poses; range of each joint by itself (share of its travel):"
    assert [line.count("-90 to 46 deg (38%)") for line in lines] == [3, 1]
    assert lines[0].startswith("J1 -90 to 46 deg (38%)")
    assert [lines[0].index(f"J{n}") for n in (1, 2, 3)] == [0, 27, 54]


@pytest.mark.parametrize(
    ("share", "many"), [(0.5, "50 %"), (0.01, "1 %"), (0.0099, "under 1 %"), (0.0, "under 1 %")]
)
def test_how_much_of_the_ranges_is_like_what_was_measured(share, many):
    assert ranges(2, share)[0] == (
        f"of poses in these ranges (share of travel), {many} are like those measured:"
    )


def test_a_paragraph_has_its_name_at_the_left_once_and_commands_whole():
    words = " ".join(["word"] * 40)
    command = "kinacc fitted " + "x" * 100
    lines = paragraph("check", [words, command])
    assert lines[0].startswith("check" + " " * 12 + "word")
    assert all(line.startswith(" " * 17) for line in lines[1:])
    assert lines[1].startswith(" " * 19 + "word")
    assert lines[-1].strip() == command
    assert max(map(len, lines[:-1])) <= 100
