"""``kinacc fitted``: what the fits of a results folder are worth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import click

from kinacc.artifacts.error_models import ERROR_MODELS, NOMINAL, PLAINEST
from kinacc.cli.output import Output, answers, plain

IF_THERE = ("data_check", "excluded_rows", "compliance_model")
TABLES = ("residuals", "model_selection", "dh_identified", "vec_model", "worst_rows")
_MODELS = (NOMINAL, *ERROR_MODELS)
_LEVER = "lever_coefficient_rad_per_mm"
_FIGURES = ("n", "rms", "mean", "max")
_SUBSETS = ("train", "validation")
_WORST = 5


@click.command("fitted")
@click.argument("folder", type=click.Path())
@answers("Print JSON instead of text.")
def fitted(folder: str, out: Output) -> None:
    """Say what the fits of FOLDER, a results folder of a data set, are worth.

    Position errors of rows that trained and of rows held out, the model these select, what the
    poses could not tell apart, and the rows the selected model fits worst.

    \b
    Example:
      kinacc fitted results/ur10_b
      kinacc fitted results/ur10_b --json
    """
    answer = summary(read(Path(folder)))
    out.say(answer, in_words(Path(folder).name, answer))


def read(folder: Path) -> dict[str, dict]:
    """The tables needed. Raises InputError naming all that are missing."""
    from kinacc.artifacts import store
    from kinacc.errors import Problem, refuse

    paths = {name: folder / f"{name}.parquet" for name in TABLES}
    missing = [
        Problem(str(path), "no such file", fix="run the workflow first")
        for path in paths.values()
        if not path.is_file()
    ]
    refuse(missing, f"{folder} holds no fits")
    more = {name: folder / f"{name}.parquet" for name in IF_THERE}
    paths |= {name: path for name, path in more.items() if path.is_file()}
    return {name: store.read(path) for name, path in paths.items()}


def summary(tables: Mapping[str, Mapping]) -> dict:
    """The answer as plain values: errors in mm by model and subset, selection, statements, rows."""
    from kinacc.calibration import blind_words
    from kinacc.workflow.stages import data_check

    excluded = tables.get("excluded_rows")
    compared = {str(name) for name in tables["residuals"]["comparison"]}
    models = [model for model in _MODELS if f"{model}_vs_measured" in compared]
    choice, told = tables["model_selection"], tables["dh_identified"]
    selected = next(
        str(name) for name, yes in zip(choice["model"], choice["selected"], strict=True) if yes
    )
    gain = choice["gain_mm2"][list(choice["model"]).index("vec")]
    error = choice["gain_std_error_mm2"][list(choice["model"]).index("vec")]
    return {
        "selected": selected,
        "gain_of_vec_mm2": plain(gain),
        "gain_std_error_mm2": plain(error),
        "vec_order": int(max(tables["vec_model"]["order"])),
        "position_error_mm": {
            model: {subset: _errors(tables["residuals"], model, subset) for subset in _SUBSETS}
            for model in models
        },
        "parameters": {
            status: [
                str(p)
                for p, s in zip(told["parameter"], told["status"], strict=True)
                if s == status
            ]
            for status in dict.fromkeys(str(each) for each in told["status"])
        },
        "undetermined": blind_words.listed(told),
        "worst_rows": _worst(tables["worst_rows"], selected),
        "data": data_check.in_words(tables["data_check"]) if "data_check" in tables else [],
        "excluded": None if excluded is None else _excluded(excluded, selected),
        "position_error_with_excluded_mm": None
        if excluded is None
        else {model: _with_excluded(tables["residuals"], excluded, model) for model in models},
        "gains_mm2": _gains(choice),
        "bending": _bending(tables.get("compliance_model", {})),
    }


def _gains(choice: Mapping) -> dict[str, dict]:
    """Squared error that each model takes off that of the plainest one, and its standard error."""
    columns = (choice[name] for name in ("model", "gain_mm2", "gain_std_error_mm2"))
    return {
        str(model): {"gain": plain(gain), "std_error": plain(error)}
        for model, gain, error in zip(*columns, strict=True)
        if model != PLAINEST
    }


def _bending(table: Mapping) -> list[dict]:
    """Fitted coefficients of joints that bend, each with its standard deviation."""
    names = ("compliance_rad_per_nm", "lever_coefficient_rad_per_mm")
    return [
        {"joint": int(joint)}
        | {each: plain(table[each][row]) for name in names for each in (name, f"std_{name}")}
        for row, joint in enumerate(table.get("joint", ()))
        if any(table[name][row] == table[name][row] for name in names)
    ]


def _errors(table: Mapping, model: str, subset: str) -> dict | None:
    for i, comparison in enumerate(table["comparison"]):
        wanted = comparison == f"{model}_vs_measured" and table["subset"][i] == subset
        if wanted and table["quantity"][i] == "position" and table["fold"][i] != table["fold"][i]:
            return {name: plain(table[name][i]) for name in _FIGURES}
    return None


def _excluded(table: Mapping, model: str) -> list[dict]:
    """The rows of one model, each with its error: null where it could not be read."""
    import numpy as np

    size = np.linalg.norm([table[f"e{axis}_mm"] for axis in "xyz"], axis=0)
    rows = np.flatnonzero(table["comparison"] == f"{model}_vs_measured")
    return [
        {
            "line": int(table["line"][row]),
            "reason": str(table["reason"][row]),
            "error_mm": plain(size[row]),
        }
        for row in rows[np.argsort(table["line"][rows], kind="stable")]
    ]


def _with_excluded(residuals: Mapping, excluded: Mapping, model: str) -> dict | None:
    """Held-out figures with the rows that the configuration leaves out of all fits."""
    import numpy as np

    held_out = _errors(residuals, model, "validation")
    rows = excluded["comparison"] == f"{model}_vs_measured"
    size = np.linalg.norm([excluded[f"e{axis}_mm"][rows] for axis in "xyz"], axis=0)
    size = size[np.isfinite(size)]
    if held_out is None:
        return None
    n, more = held_out["n"], len(size)
    return {
        "n": n + more,
        "rms": float(np.sqrt((n * held_out["rms"] ** 2 + np.sum(size**2)) / (n + more))),
        "mean": float((n * held_out["mean"] + np.sum(size)) / (n + more)),
        "max": float(max(held_out["max"], *size, 0.0)),
    }


def _worst(table: Mapping, model: str) -> list[dict]:
    rows = [
        i
        for i, comparison in enumerate(table["comparison"])
        if comparison == f"{model}_vs_measured"
    ]
    held_out = [i for i in rows if table["estimate"][i] == "cross_validated"] or rows
    held_out.sort(key=lambda i: table["rank"][i])
    return [
        {
            "line": plain(table["line"][i]),
            "row": int(table["row"][i]),
            "pose": int(table["pose"][i]),
            "target": str(table["target"][i]),
            "error_mm": plain(table["error_mm"][i]),
        }
        for i in held_out[:_WORST]
    ]


def in_words(name: str, answer: Mapping) -> str:
    """The summary for people."""
    lines = [f"{name}: {answer['selected']} is selected{_why(answer)}", ""]
    lines.append("position error, mm    training rms   held out: rms     mean      max")
    for model, of in answer["position_error_mm"].items():
        called = f"vec (order {answer['vec_order']})" if model == "vec" else model
        train, out = (of[subset] or {} for subset in _SUBSETS)
        figures = [train.get("rms"), *(out.get(each) for each in ("rms", "mean", "max"))]
        shown = ["       -" if each is None else f"{each:8.3f}" for each in figures]
        lines.append(f"{called:20} {shown[0]:>13}   {shown[1]:>13} {shown[2]} {shown[3]}")
        if more := (answer["position_error_with_excluded_mm"] or {}).get(model):
            shown = [f"{more[each]:8.3f}" for each in _FIGURES[1:]]
            lines.append(f"  with excluded rows {'':13}   {shown[0]:>13} {shown[1]} {shown[2]}")
    if answer["excluded"]:
        lines += ["", "rows excluded by the configuration:"]
        for each in answer["excluded"]:
            error = "" if each["error_mm"] is None else f", {each['error_mm']:.3f} mm"
            lines.append(f"  line {each['line']}{error}: {each['reason']}")
    count = {status: len(names) for status, names in answer["parameters"].items()}
    listed = ", ".join(f"{number} {status}" for status, number in count.items())
    lines += ["", f"parameters of the DH fit: {listed}"]
    if answer["bending"]:
        lines += ["", "joints that bend under gravity:", *_bending_in_words(answer["bending"])]
    if answer["undetermined"]:
        lines.append("what the poses that were fitted leave open:")
        lines += [f"  - {text}" for text in answer["undetermined"]]
    lines += ["", f"largest position errors ({answer['selected']}):"]
    for row in answer["worst_rows"]:
        where = f"row {row['row']}" if row["line"] is None else f"line {row['line']:.0f}"
        lines.append(f"  {where}, pose {row['pose']}, {row['target']}: {row['error_mm']:.3f} mm")
    if answer["data"]:
        lines += ["", "what the check of the data found:"]
        lines += [f"  - {text}" for text in answer["data"]]
    return "\n".join(lines)


def _bending_in_words(bending: list[Mapping]) -> list[str]:
    lines, products = [], []
    for each in bending:
        for name, per in (("compliance_rad_per_nm", "N m"), (_LEVER, "mm of lever")):
            if each[name] is None:
                continue
            std = each[f"std_{name}"]
            sure = "(not determined)" if std is None else f"+- {1e6 * std:.3g}"
            lines.append(f"  joint {each['joint']}: {1e6 * each[name]:.4g} {sure} urad per {per}")
        if each[_LEVER] is not None:
            products.append(str(each["joint"]))
    if products:
        alone = all(each["compliance_rad_per_nm"] is None for each in bending)
        load = (
            ", and for the payload that was measured" if alone else " of what the arm itself weighs"
        )
        lines.append(
            f"  Masses are not stated: of joint {', '.join(products)} only the product of weight "
            f"and compliance can be seen{load}."
        )
    return lines


def _why(answer: Mapping) -> str:
    gains = {
        name.upper() if name == "vec" else name: of for name, of in answer["gains_mm2"].items()
    }
    names = " and ".join(gains)
    if any(each["gain"] is None for each in gains.values()):
        return f": nothing was held out to judge the {names} model by"
    told = []
    for name, each in gains.items():
        sure = "" if each["std_error"] is None else f" +- {each['std_error']:.4f}"
        what = "" if told else "the squared error of held-out rows is "
        less = "less" if each["gain"] > 0 else "more"
        told.append(f"with {name} {what}{abs(each['gain']):.4f}{sure} mm^2 {less}")
    if any(each["std_error"] is None for each in gains.values()):
        return f": {', '.join(told)}"
    one = names if len(gains) == 1 else "another model than DH"
    return f": {', '.join(told)}; {one} has to be less by more than two standard errors"
