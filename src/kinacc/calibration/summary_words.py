"""What a calibration is worth, in the lines of half a page."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence

from kinacc.calibration.blind_words import weak
from kinacc.calibration.model_comparison import STANDARD_ERRORS
from kinacc.calibration.summary import LARGE_SHARE, SETTINGS, Fact, of
from kinacc.config.error_models import NOMINAL, PLAINEST, model_name
from kinacc.tables.allowed import FINDING_LEVELS, LEFT_OUT

WIDTH = 100
MARGIN = 17  # where the text of a paragraph begins
_MOST, _LINES = 3, 5  # findings, excluded rows, sentences that are told, and lines they may take
_LINES_EACH = 2  # of what is left out: a list of columns may be long
_JOINTS_PER_LINE, _JOINT_WIDTH = 3, 27
_KEPT = "\u00a0"  # a space that no line is broken at
_FIGURES = ("mean", "quantile_99", "largest")
_COLUMNS = {"mean": 8, f"{LARGE_SHARE:.0%} empirical": 14, "largest": 8}  # widths
_CALLED = 53  # of a model's name before them
_COMPLIANCE, _LEVER = "compliance_rad_per_nm", "lever_coefficient_rad_per_mm"
_BEFORE_ERRORS = ("data", "check", "excluded")
_SETTLED = '"others may": measure such (kinacc plan-poses) or state it (calibration.frames)'
_NUMBERS = {2.0: "two"}


def half_page(facts: Sequence[Fact], more: str, whole: bool = False) -> list[str]:
    """The facts in lines of at most WIDTH characters.

    ``more``: the command that tells all of it; ``whole``: tell all of it.
    """
    told = {name: paragraph(name, texts) for name, texts in texts_of(facts, more, whole).items()}
    before = [line for name in _BEFORE_ERRORS for line in told.pop(name)]
    return [*before, *_errors(facts, whole), *(line for each in told.values() for line in each)]


def texts_of(facts: Sequence[Fact], more: str, whole: bool = False) -> dict[str, list[str]]:
    """What is said under each name, in order, beside the errors; see :func:`half_page`."""
    most = None if whole else _MOST
    return {
        "data": [*_data(facts), *_left_out(facts, most, more)],
        "check": _checked(facts, most, more),
        "excluded": _excluded(facts, most, more),
        "selected": selected(facts),
        "bending": _bending(of(facts, "bending")),
        "valid where": _range(facts),
        "undetermined": _undetermined(facts, most, more),
    }


def paragraph(name: str, texts: Iterable[str]) -> list[str]:
    """Texts under a name at the left, each on lines of its own; commands are not broken."""
    lines = [line for text in texts for line in _wrapped(text)]
    heads = [name, *[""] * len(lines)]
    return [f"{head:{MARGIN}}{line}" for head, line in zip(heads, lines, strict=False)]


def counted(number: float, noun: str) -> str:
    """``1 pose``, ``2 poses``."""
    return f"{number:.0f} {noun}{'' if number == 1 else 's'}"


def _data(facts: Sequence[Fact]) -> list[str]:
    data = of(facts, "data")["measurements"]
    number = {name: each.value for name, each in data.items()}
    of_what = "a synthetic arm" if data["source"].text == "synthetic" else "a measured arm"
    robot = next(iter(of(facts, "robot")))
    targets = counted(number["targets"], "target")
    poses = counted(number["poses"], "pose")
    lines = [
        f"{counted(number['readings'], 'reading')} of {targets} at {poses}: {robot}, {of_what}"
    ]
    if of(facts, "held_out_error") and not of(facts, "held_out_orientation_error"):
        lines.append("positions only: how the tool is turned is judged nowhere on this page")
    if number["fitted"] < number["readings"]:
        rest = number["readings"] - number["fitted"]
        told = f"models fitted to {number['fitted']:.0f} of them, {rest:.0f} held out"
        lines.append(f"{told} (measurements.validation_fold)")
    return lines


def _left_out(facts: Sequence[Fact], most: int | None, more: str) -> list[str]:
    told = [each.text for each in facts if each.topic == LEFT_OUT and each.text]
    if most is None:
        return told
    room = _LINES_EACH * (WIDTH - MARGIN)
    return _first([textwrap.shorten(each, room, placeholder=" ..") for each in told], most, more)


def _checked(facts: Sequence[Fact], most: int | None, more: str) -> list[str]:
    """Suspicions, then notes, which are none: as ``check-data`` tells the two apart."""
    found = [each for each in facts if each.topic == "check"]
    if not found:
        return []
    told = [each for each in found if each.text]
    notes = [each for each in told if each.statistic == FINDING_LEVELS[-1]]
    doubts = [each.text for each in told if each not in notes] or ["nothing suspicious"]
    plain = [f"note: {each.text.removeprefix(f'{each.item}: ')}" for each in notes]
    return _first([*doubts, *plain], most, more)


def _excluded(facts: Sequence[Fact], most: int | None, more: str) -> list[str]:
    told = []
    for each in facts:
        if each.topic == "excluded_rows":
            error = "" if each.unit is None else f", {each.value:.3f} mm"
            told.append(f"{each.item}{error}: {each.text}")
    return _first(told, most, more)


def _errors(facts: Sequence[Fact], whole: bool) -> list[str]:
    """Tables of errors, each of one population."""
    held_out, trained = of(facts, "held_out_error"), of(facts, "training_error")
    lines = []
    if held_out:
        lines += _table(facts, "held-out error, mm", "poses left out of the fit", held_out)
        lines += _orientation(facts, whole)
    if trained and (whole or not held_out):
        lines += _table(facts, "training error, mm", "poses that were fitted", trained)
    return lines


def _table(
    facts: Sequence[Fact], name: str, where: str, errors: Mapping[str, Mapping[str, Fact]]
) -> list[str]:
    chosen = of(facts, "selection")
    rows = next(iter(errors.values()))["n"].value
    head = f"{name} ({where}; {counted(rows, 'row')})"
    lines = [f"{head:57}" + "".join(f"{name:>{width}}" for name, width in _COLUMNS.items())]
    for model, figures in errors.items():
        called = model_called(facts, model)
        mark = "  <- selected" if model in chosen and chosen[model]["selected"].value else ""
        sizes = zip(_FIGURES, _COLUMNS.values(), strict=True)
        shown = "".join(f"{figures[each].value:{width}.3f}" for each, width in sizes)
        spare = min(0, _CALLED - len(called))  # a long name takes of the blanks behind it
        lines.append(f"{'':4}{called:{_CALLED}}{shown[-spare:]}{mark}".rstrip())
    return lines


def model_called(facts: Sequence[Fact], model: str) -> str:
    """A model with what belongs to its name: its order, or what of the nominal one is fitted."""
    if model == NOMINAL:
        fitted = of(facts, "robot")["base and tool"]["fitted"].value
        return "nominal, with base and tool fitted" if fitted else "nominal"
    known = of(facts, "selection")[model]
    return model_name(model) + (_order(known) if "order" in known else "")


def _orientation(facts: Sequence[Fact], whole: bool) -> list[str]:
    """Errors of orientation at held-out poses, where it was measured: the selected model's."""
    chosen, known = of(facts, "selection"), of(facts, "held_out_orientation_error")
    lines = []
    for model, figures in known.items():
        if whole or (model in chosen and chosen[model]["selected"].value):
            rows = counted(figures["n"].value, "row")
            called = f"orientation, {model_name(model)}, in mrad ({rows})"
            sizes = zip(_FIGURES, _COLUMNS.values(), strict=True)
            shown = "".join(f"{figures[each].value:{width}.3f}" for each, width in sizes)
            lines.append(f"{'':4}{called:{_CALLED}}{shown}")
    return lines


def _order(known: Mapping[str, Fact]) -> str:
    """The order of a model, with those its held-out errors were found with where they differ."""
    order = {name: each.value for name, each in known.items() if "order" in name}
    told = f", order {order['order']:.0f}"
    low, high = (order.get(f"{which}_order_held_out", order["order"]) for which in ("low", "high"))
    folds = f" (held out: {low:.0f} to {high:.0f})" if low < high else ""
    if order["order"] != order.get("highest_order_tried"):
        return told + folds
    by_settings = known["highest_order_set_by"].text == SETTINGS
    if folds:
        return f"{told}{folds}, {'the most allowed' if by_settings else 'all the data carry'}"
    if by_settings:
        return f"{told}, the highest allowed (vec.order_highest)"
    return f"{told}, the highest {known['configurations'].value:.0f} configurations carry"


def selected(facts: Sequence[Fact]) -> list[str]:
    """Why the selected model is selected, and a warning where the nominal one is nearer."""
    models, held_out = of(facts, "selection"), of(facts, "held_out_error")
    best = next(model for model, known in models.items() if known["selected"].value)
    if not held_out or held_out[best]["mean"].value < held_out[NOMINAL]["mean"].value:
        return [_why(models)]
    text = f"{model_name(best)} is no nearer to held-out poses than the nominal model is"
    return [_why(models), f"{text}: measure more poses, or correct the data"]


def _why(models: Mapping[str, Mapping[str, Fact]]) -> str:
    """Why the selected model is selected, in a sentence."""
    number = {
        model: {name: each.value for name, each in known.items()} for model, known in models.items()
    }
    choice = next(model for model, known in number.items() if known["selected"])
    others = [model for model in number if model != choice]
    if not others:
        return f"{model_name(choice)} is the only model"
    if any(known["gain"] != known["gain"] for known in number.values()):
        listed = " and ".join(map(model_name, others))
        return f"{model_name(choice)} is selected: no pose was held out to judge {listed} by"
    if choice != PLAINEST:
        change = _change(number[choice])
        told = (
            f"on held-out poses its squared error is {change} than that of {model_name(PLAINEST)}"
        )
        more = "; no other model has less" if len(others) > 1 else ""
        return f"{model_name(choice)} is selected: {told}, more than {_needed()}{more}"
    told = "; ".join(
        f"with {model_name(each)} it is {_change(number[each])}{_not_enough(number[each])}"
        for each in others
    )
    told = told.replace("it is", "the squared error of held-out poses is", 1)
    return f"{model_name(choice)} is selected: {told}"


def _change(known: Mapping[str, float]) -> str:
    """How much higher or lower the squared error is than that of the plainest model."""
    gain, error = abs(known["gain"]), known["gain_std_error"]
    form = ".3f" if min(gain, error) >= 0.001 else ".2g"
    spread = "" if error != error else f" +- {error:{form}}"
    number = f"{gain:{form}}{spread} mm^2".replace(" ", _KEPT)
    return f"{'lower' if known['gain'] > 0 else 'higher'} by {number}"


def _not_enough(known: Mapping[str, float]) -> str:
    if known["gain"] <= 0:
        return ""
    if known["gain"] > STANDARD_ERRORS * known["gain_std_error"]:
        return ", but its rms over all rows or over folds is not"
    return f", no more than {_needed()}"


def _needed() -> str:
    return f"{_NUMBERS.get(STANDARD_ERRORS, f'{STANDARD_ERRORS:g}')} standard errors"


def _bending(joints: Mapping[str, Mapping[str, Fact]]) -> list[str]:
    """Coefficients of joints that bend under gravity, and what cannot be told of them."""
    lines, products = [], []
    for joint, known in joints.items():
        for name, per in ((_COMPLIANCE, "N m"), (_LEVER, "mm of lever")):
            if name in known:
                std = known.get(f"std_{name}")
                sure = "(not determined)" if std is None else f"+- {1e6 * std.value:.3g}"
                lines.append(f"{joint}: {1e6 * known[name].value:.4g} {sure} urad per {per}")
        products += [joint.removeprefix("joint ")] if _LEVER in known else []
    if products:
        alone = not any(_COMPLIANCE in known for known in joints.values())
        load = ", and for the payload that was measured" if alone else " of the arm's own weight"
        lines.append(
            f"masses are not stated: of joint {', '.join(products)} only the product of weight and "
            f"compliance can be seen{load}"
        )
    return lines


def _range(facts: Sequence[Fact]) -> list[str]:
    """Ranges of the joints, and how much of the box they span was measured."""
    joints, known = of(facts, "range"), of(facts, "like_measured")
    head = "near the measured poses; range of each joint by itself (share of its travel):"
    if known:
        share = next(iter(known.values()))["share"].value
        many = f"{100 * share:.0f} %" if share >= 0.01 else "under 1 %"
        head = f"of poses in these ranges (share of travel), {many} are like those measured:"
    told = [
        f"{name.replace('joint ', 'J')} {known['low'].value:.0f} to {known['high'].value:.0f} "
        f"{known['low'].unit} ({known['share'].value:.0%})".ljust(_JOINT_WIDTH)
        for name, known in joints.items()
    ]
    lines = [told[i : i + _JOINTS_PER_LINE] for i in range(0, len(told), _JOINTS_PER_LINE)]
    return [head, *("".join(line).rstrip().replace(" ", _KEPT) for line in lines)]


def _undetermined(facts: Sequence[Fact], most: int | None, more: str) -> list[str]:
    told = [each.text for each in facts if each.topic == "undetermined"]
    told.sort(key=lambda text: not weak([text]))  # first what further poses would settle
    shown = _first(told, most, more) or ["nothing: the poses determine every parameter"]
    if not weak(shown):
        return shown
    cause = [
        f"the flange points one way in all poses (within {each.value:.2g} {each.unit}), hence "
        '"too little"'
        for each in facts
        if each.topic == "one_way"
    ]
    count = sum(text in told for text in shown)
    return [*shown[:count], *cause, _SETTLED, *shown[count:]]


def _first(texts: list[str], most: int | None, more: str) -> list[str]:
    """The first ``most`` texts, fewer where they are long, and where the others are."""
    if most is None:
        return texts
    told = [
        text for i, text in enumerate(texts[:most]) if not i or _lines(texts[: i + 1]) <= _LINES
    ]
    left = len(texts) - len(told)
    return [*told, f"and {left} more: {more}"] if left else told


def _lines(texts: Iterable[str]) -> int:
    return sum(len(_wrapped(text)) for text in texts)


def _wrapped(text: str) -> list[str]:
    """The lines of a text; a command is not broken."""
    if text.startswith("kinacc "):
        return [text]
    room = WIDTH - MARGIN
    lines = textwrap.wrap(text, room, subsequent_indent="  ", break_on_hyphens=False)
    return [line.replace(_KEPT, " ") for line in lines]
