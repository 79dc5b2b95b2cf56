"""What really differs between two results folders, and whether a gate's answer says so.

Nothing here is of `kinacc.gate`: tables are read with pandas and compared number by number.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

# A difference is sure above so much in its unit, and sure to be none below a hundredth of it.
SURE = {"mm": 1e-5, "mrad": 1e-5, "rad": 1e-8, "deg": 1e-6}
# Of what has another unit, as a share of the largest number of its column.
SURE_SHARES = {
    "see unit": 1e-5,
    "see statement": 1e-5,
    "1": 1e-5,
    "product of the units of both": 1e-2,
}
SURE_SHARE = 1e-3
# Tables of parameters, which the poses may leave undetermined: what they predict decides.
PREDICTED = {
    "dh": ("dh_model", "frames", "dh_fit", "dh_covariance", "dh_identified"),
    "vec": ("vec_model", "vec_frames", "vec_fit", "vec_covariance"),
    "compliance": (
        "compliance_model",
        "compliance_frames",
        "compliance_fit",
        "compliance_covariance",
    ),
}
RANDOM = ("study_chunk", "study", "study_summary", "readings", "histories", "claims")
NO, PERHAPS, YES = 0, 1, 2
Found = Mapping[tuple[str, str], int]


def tables(results: Path) -> dict[tuple[str, str], list[Path]]:
    """Files of every table by data set and artefact, parts together."""
    found: dict[tuple[str, str], list[Path]] = {}
    for path in sorted(results.glob("*/*.parquet")) + sorted(results.glob("*/*/*.parquet")):
        dataset, *rest = path.relative_to(results).parts
        found.setdefault((dataset, rest[0].removesuffix(".parquet")), []).append(path)
    return found


def differing(before: Path, after: Path, random: bool = False) -> dict[tuple[str, str], int]:
    """By data set and artefact whether it differs: surely not, perhaps, surely.

    ``random``: random tables may differ within their standard error, whether they do or not.
    """
    old, new, found = tables(before), tables(after), {}
    for key in {**old, **new}:
        if key not in old or key not in new:
            found[key] = YES
        elif [each.read_bytes() for each in old[key]] == [each.read_bytes() for each in new[key]]:
            found[key] = NO
        else:
            found[key] = differ(_read(old[key]), _read(new[key]))
        if random and key[1] in RANDOM:
            found[key] = min(found[key], PERHAPS)
    for dataset in {key[0] for key in found}:
        for model, names in PREDICTED.items():
            # Another parameter may predict the same poses; what it predicts is in pose_errors.
            same = _predicts_the_same(old, new, dataset, model)
            for name in names:
                if (dataset, name) in found and same:
                    found[dataset, name] = min(found[dataset, name], PERHAPS)
    return found


def _read(paths: Sequence[Path]) -> pd.DataFrame:
    """A table with the units of its columns as an attribute; parts in one order of rows."""
    read = [pq.read_table(path) for path in paths]
    joined = pd.concat([each.to_pandas() for each in read], ignore_index=True)
    if len(read) > 1:
        keys = [name for name in joined if name not in ("assessed_mm", "lower_mm", "upper_mm")]
        joined = joined.sort_values(keys, ignore_index=True)
    joined.attrs["units"] = {
        each.name: (each.metadata or {}).get(b"unit", b"").decode() for each in read[0].schema
    }
    return joined


def differ(old: pd.DataFrame, new: pd.DataFrame) -> int:
    """Whether two tables differ: surely not, perhaps, surely."""
    if list(old) != list(new) or len(old) != len(new):
        return YES
    units = old.attrs["units"]
    return max((_column(old[name], new[name], units[name]) for name in old), default=NO)


def _column(old: pd.Series, new: pd.Series, unit: str) -> int:
    null = old.isna().to_numpy()
    if (null != new.isna().to_numpy()).any():
        return YES
    one, other = old[~null].to_numpy(), new[~null].to_numpy()
    if not len(one) or np.array_equal(one, other):
        return NO
    if one.dtype.kind != "f":
        whole = one.dtype.kind in "iub"
        return YES if whole or any(a != b for a, b in zip(one, other, strict=True)) else NO
    apart = np.max(np.abs(one - other))
    sure = SURE.get(unit, SURE_SHARES.get(unit, SURE_SHARE) * float(np.max(np.abs(one))))
    return YES if apart > sure else NO if apart == 0 else PERHAPS


def _predicts_the_same(old: Mapping, new: Mapping, dataset: str, model: str) -> bool:
    """Whether a model of both runs is as far from the same measured poses, or that is unknown.

    Only the errors of the delivered fit tell; where the measured poses differ, all is open.
    """
    key, measured = (dataset, "pose_errors"), (dataset, "measurements")
    if any(each not in side for each in (key, measured) for side in (old, new)):
        return True
    if differ(_read(old[measured]), _read(new[measured])) != NO:
        return False
    errors = []
    for side in (old, new):
        table = _read(side[key])
        rows = table["comparison"].str.startswith(f"{model}_vs") & (table["estimate"] == "train")
        part = table[rows].reset_index(drop=True)
        part.attrs = table.attrs
        errors.append(part)
    return differ(*errors) != YES


@dataclass(frozen=True)
class Said:
    """What a gate said: a difference of an artefact with its causes, or an outcome's words."""

    dataset: str
    artefact: str
    causes: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Answer:
    """The parts of a gate's JSON that are judged."""

    differences: tuple[Said, ...]
    failed: tuple[str, ...]  # what failed outcomes say
    words: str  # what all outcomes of the comparison say
    worse: Mapping[str, str]  # verdict on a change for the worse, by data set

    @classmethod
    def of(cls, told: object, sound: bool = False) -> Answer:
        """From the JSON, by the fields of its records alone.

        ``sound``: what fails since files do not fit their records counts as well; pictures that are
        not drawn anew do not fit.
        """
        outcomes = [each for each in mappings(told) if {"verdict", "says", "kind"} <= each.keys()]
        compared = [each for each in outcomes if each["kind"] == "accepted"]
        differences = tuple(
            Said(
                each.get("dataset") or outcome["dataset"],
                each["artefact"],
                tuple((cause["kind"], cause["where"]) for cause in each["causes"]),
            )
            for outcome in compared
            for each in mappings(outcome)
            if {"artefact", "causes"} <= each.keys()
        )
        counted = [each for each in outcomes if sound or each["kind"] != "results"]
        failed = [each for each in counted if each["verdict"] == "failed"]
        return cls(
            differences,
            tuple(f"{each['kind']} {each['says']} {_deep(each)}" for each in failed),
            " ".join(_deep(each) for each in compared),
            {each["dataset"]: each["verdict"] for each in outcomes if each["kind"] == "change"},
        )


def mappings(value: object) -> Iterable[Mapping]:
    if isinstance(value, Mapping):
        yield value
        value = value.values()
    if isinstance(value, Iterable) and not isinstance(value, str):
        for each in value:
            yield from mappings(each)


def _deep(value: object) -> str:
    if isinstance(value, Mapping):
        return " ".join(map(_deep, value.values()))
    if isinstance(value, list | tuple):
        return " ".join(map(_deep, value))
    return str(value)


def faults_of(
    answer: Answer,
    truth: Found,
    causes: Sequence[tuple[str, str]],
    elsewhere: bool = False,
    only: Sequence[tuple[str, Sequence[tuple[str, str]]]] = (),
) -> list[str]:
    """What is wrong with a gate's answer to one planted change; nothing where all is right.

    ``elsewhere``: a table that no longer fits its record may be told as unsound instead. ``only``:
    by a pattern of ``data set/artefact`` those of the causes that lead to it.
    """
    found = []
    named = {(each.dataset, each.artefact) for each in answer.differences}
    sure = {key for key, value in truth.items() if value == YES}
    open_ = {key for key, value in truth.items() if value == PERHAPS}
    unsound = {key for key in sure if any(_named(key, words) for words in answer.failed)}
    missing = sure - named - (unsound if elsewhere else set())
    if sure and not answer.failed:
        found.append("not told: nothing failed")
    if not sure and not open_ and answer.failed:
        found.append(f"failed although no number differs: {'; '.join(answer.failed)[:300]}")
    if missing:
        found.append(f"differ and are not named: {_list(missing)}")
    if extra := named - sure - open_:
        found.append(f"named though they are the same: {_list(extra)}")
    if (
        not sure
        and not named
        and not any(re.search(_loose(where), answer.words) for _, where in causes)
    ):
        found.append(f"cause not told: {causes}")
    wrong = sorted(
        {
            f"{each.dataset}/{each.artefact} by {each.causes}"
            for each in answer.differences
            if not each.causes or not _all_fit(each, causes, only)
        }
    )
    if wrong:
        found.append(f"explained wrongly ({len(wrong)}): {'; '.join(wrong[:3])}")
    return found


ALLOWED_MM = 0.02


def faults_on_worse(answer: Answer, before: Path, after: Path) -> list[str]:
    """What is wrong with the gate that allows a mean error ALLOWED_MM larger, beyond chance.

    Far beyond chance it has to fail, and where no more than that is found it must not.
    """
    faults = []
    for dataset, verdict in answer.worse.items():
        old, new = (_held_out_mm(side / dataset) for side in (before, after))
        found = new.mean() - old.mean()
        error = np.hypot(*(each.std(ddof=1) / np.sqrt(len(each)) for each in (old, new)))
        said = f"{dataset} is {found:.3f} mm worse, of {error:.3f} mm by chance: {verdict}"
        if found > ALLOWED_MM + 6.0 * error and verdict != "failed":
            faults.append(said)
        if found < ALLOWED_MM and verdict == "failed":
            faults.append(said)
    return faults if answer.worse else ["no gate on a change for the worse"]


def _held_out_mm(folder: Path) -> np.ndarray:
    table = pq.read_table(folder / "pose_errors.parquet").to_pandas()
    rows = (table["comparison"] == "dh_vs_measured") & (table["estimate"] == "cross_validated")
    return np.sqrt((table.loc[rows, ["ex_mm", "ey_mm", "ez_mm"]] ** 2).sum(axis=1)).to_numpy()


def _all_fit(said: Said, causes: Sequence[tuple[str, str]], only: Sequence) -> bool:
    name = f"{said.dataset}/{said.artefact}"
    of_this = next((some for pattern, some in only if re.search(pattern, name)), causes)
    return all(_fits(cause, of_this) for cause in said.causes)


def _fits(cause: tuple[str, str], causes: Sequence[tuple[str, str]]) -> bool:
    return any(cause[0] == kind and re.search(where, cause[1]) for kind, where in causes)


def _named(key: tuple[str, str], words: str) -> bool:
    return (
        re.search(rf"\b{key[0]}\b", words) is not None
        and re.search(rf"\b{key[1]}\b", words) is not None
    )


def _loose(where: str) -> str:
    return where.strip("^$")


def _list(keys: Iterable[tuple[str, str]]) -> str:
    names = sorted("/".join(key) for key in keys)
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
