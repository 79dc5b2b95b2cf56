"""Check of a results folder: digests, schemas, thresholds of the configuration, an accepted run."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from kinacc.config.schema import defaults
from kinacc.errors import Problem, and_more, first_few, input_error
from kinacc.gate.accepted import compared
from kinacc.gate.conformity import check_file
from kinacc.gate.gates import judged
from kinacc.gate.outcome import FAILED, PASSED, WARNED, CheckReport, Outcome
from kinacc.tables import sums
from kinacc.tables.contract import ARTEFACTS
from kinacc.workflow.data_sets import DataSets, data_sets
from kinacc.workflow.described import beside, made_with_other_settings

_NEEDED = ("measurements", "robot", "vec_model", "dh_model", "frames", "residuals", "pose_errors")
_SHOWN = 3


def check_results(
    results: Path,
    configurations: Mapping[str, Mapping[str, Any]],
    against: Path | None = None,
    datasets: Sequence[str] = (),
) -> CheckReport:
    """Check the data sets of a results folder.

    Parameters
    ----------
    results
        Folder with a folder for each data set.
    configurations
        Complete settings by data set, whose section ``gates`` holds the thresholds.
    against
        An accepted run, or any other results, to compare with.
    datasets
        Names of the only data sets checked; all that are configured or there if empty.

    Raises
    ------
    InputError
        Where there is no such folder or data set.
    """
    names = list(datasets) or sorted({*configurations, *data_sets_in(results)})
    if not names:
        raise input_error(str(results), "holds no data set", "a folder of results")
    data = data_sets(configurations) if configurations else None
    outcomes = [check_files(results / name, data) for name in names]
    broken = {item.dataset for item in outcomes if item.verdict == FAILED}
    chosen = {name: subset for name, subset in configurations.items() if name in names}
    outcomes += judged(results, chosen, against, broken)
    if against is not None:
        for name in names:
            if name not in broken:
                subset = configurations.get(name, defaults())["calibration"]
                weight = subset["rotation_weight_mm_per_rad"]
                outcomes += compared(results / name, against / name, weight)
    return CheckReport(str(results), str(against or ""), tuple(outcomes))


def data_sets_in(results: Path) -> list[str]:
    """Names of the data sets in a results folder."""
    if not results.is_dir():
        raise input_error(str(results), "no such folder", fix="name a results folder")
    return sorted(item.parent.name for item in results.glob(f"*/{sums.FOLDER}"))


def check_files(folder: Path, data: DataSets | None = None) -> Outcome:
    """Whether every file of a data set is there, as its stage left it, and fits its schema.

    A warning where files or settings (``data``, where the data set is in it) have changed since.
    """
    verdict, fix, figures = WARNED, sums.AGAIN, {}
    if problems := list(_problems(folder)):
        shown = "\n".join(map(str, problems[:_SHOWN]))
        says = shown + and_more(len(problems) - _SHOWN).replace(" ", "\n", 1)
        verdict, fix, figures = FAILED, "", {"problems": len(problems)}
    elif old := sums.outdated(folder):
        says = f"{len(old)} files were made from files that have changed since: {first_few(old)}"
    elif data is not None and (old := made_with_other_settings(folder, data)):
        says = f"made with other settings than the configuration has now: {first_few(old)}"
    else:
        verdict, fix, figures = PASSED, "", {"files": len(sums.stated(folder))}
        says = (
            f"{figures['files']} files are as their stages left them, and tables fit their schemas"
        )
    return Outcome(folder.name, "files", "files", verdict, says, fix, figures)


def _problems(folder: Path) -> Iterator[Problem]:
    if not (folder / sums.FOLDER).is_dir():
        yield Problem(str(folder), f"has no {sums.FOLDER}", fix="kinacc calibrate FILE.yaml")
        return
    remaining = sums.stated(folder)
    yield from sums.changed(folder)
    if missing := [name for name in _NEEDED if f"{name}.parquet" not in remaining]:
        made = sorted(path.stem for path in (folder / sums.FOLDER).glob("*.sha256"))
        message = f"calibration not finished: no {first_few(missing, 2)}; stages done: "
        config = next((os.path.relpath(path) for path, _ in beside(folder.resolve())), "FILE.yaml")
        fix = f"kinacc calibrate {config} goes on, or prints why it stops"
        yield Problem(str(folder), message + (", ".join(made) or "none"), fix=fix)
    for path in sorted(folder.rglob("*.parquet")):
        relative = path.relative_to(folder)
        artefact = ARTEFACTS.get(relative.stem if len(relative.parts) == 1 else relative.parts[0])
        if artefact is None or relative.as_posix() not in remaining:
            fix = f"rm {path}"
            yield Problem(str(path), "is none of the tables that the stages left", fix=fix)
            continue
        yield from check_file(path, artefact)
    whole = folder / "SHA256SUMS"
    lists = sorted((folder / sums.FOLDER).glob("*.sha256"))
    if whole.is_file() and whole.read_bytes() != b"".join(path.read_bytes() for path in lists):
        message = f"is not what {sums.FOLDER}/*.sha256 hold"
        yield Problem(str(whole), message, fix=sums.remake(whole))
