"""Make the paper's study and a measured arm in other environments, and compare every number.

    python tools/versions.py FOLDER          every environment (uv makes them), and docs/versions.md
    python tools/versions.py FOLDER NAME ..  these alone; what FOLDER holds of others stays
    python tools/versions.py --compare A B   two results folders

FOLDER keeps environments and results: what is finished there is not made again. Exit code 1 where a
difference is above its tolerance. Each Python is looked for by uv; `UV` names another uv.
"""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import yaml

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "versions.md"
MEASURED = ("examples/ur10.yaml", "ur10_d")  # beside config.yaml's own data set
MATTERS = ("numpy", "scipy", "numba", "pyarrow", "pandas", "matplotlib")
UV = os.environ.get("UV", "uv")
PYTHONS = ("3.11", "3.12", "3.13")
OLD_PROCESSOR = {  # what came before 2013: other kernels of BLAS and numpy, no fused products
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL "
    "AVX512_ICL",
    "NUMBA_CPU_NAME": "nehalem",
    "NUMBA_CPU_FEATURES": "",
}


class Failed(Exception):
    """A command that ended badly, with what it said."""


@dataclass(frozen=True)
class Environment:
    """``packages`` is locked, oldest or newest; ``variables`` are those of its processes."""

    name: str
    python: str
    packages: str
    variables: dict[str, str] = field(default_factory=dict)


REFERENCE = Environment("locked-3.11", "3.11", "locked")
ENVIRONMENTS = (
    REFERENCE,
    *(Environment(f"locked-{each}", each, "locked") for each in PYTHONS[1:]),
    *(Environment(f"oldest-{each}", each, "oldest") for each in PYTHONS),
    *(Environment(f"newest-{each}", each, "newest") for each in PYTHONS[1:]),
    Environment("old-processor", "3.11", "locked", OLD_PROCESSOR),
)


@dataclass(frozen=True)
class Tolerance:
    """``absolute`` in the unit of the column; ``relative`` to the value itself."""

    absolute: float
    relative: float = 0.0

    def holds(self, one: float, other: float) -> bool:
        return abs(one - other) <= self.absolute + self.relative * abs(one)


# About a hundred times what was seen, and a thousand times below what an instrument can tell.
TOLERANCES = {
    "mm": Tolerance(1e-9),
    "mrad": Tolerance(1e-9),
    "rad": Tolerance(1e-12),
    "1": Tolerance(1e-9),
    "mm^2": Tolerance(1e-9, 1e-9),
}
OTHERWISE = Tolerance(1e-12, 1e-9)
# Singular values that are zero but for rounding are so on the scale of the largest, some 100.
# A gap is the ratio of two of them. Undetermined directions may be any basis of what they span, so
# that the projection on it is compared.
SINGULAR, LAST_STEP = "singular_value", "last_step"
GAP, DIRECTION = "gap", "undetermined_direction"
OF_QUANTITIES = {SINGULAR: Tolerance(1e-9, 1e-9), LAST_STEP: Tolerance(1e-7)}
PROJECTION = Tolerance(1e-8)


@dataclass(frozen=True)
class Difference:
    """The largest of one column; ``size`` is infinite where what has to be equal is not."""

    place: str
    unit: str
    size: float
    allowed: bool
    words: str = ""


def differences(first: Path, second: Path) -> Iterator[Difference]:
    """Every column of two results folders that differs, tables of either alone included."""
    tables = [
        {
            path.relative_to(each).as_posix(): path
            for path in Path(each).rglob("*.parquet")
            if not {"study_chunk", ".snakemake"} & set(path.relative_to(each).parts)
        }
        for each in (first, second)
    ]
    if not tables[0]:
        yield _contradiction(str(first), "no tables")
    for name in sorted({*tables[0]} ^ {*tables[1]}):
        yield _contradiction(name, "in one folder alone")
    for name in sorted({*tables[0]} & {*tables[1]}):
        yield from table_differences(name, tables[0][name], tables[1][name])


def table_differences(name: str, first: Path, second: Path) -> Iterator[Difference]:
    """Columns of two tables that differ."""
    one, other = pq.read_table(first), pq.read_table(second)
    if one.column_names != other.column_names or one.num_rows != other.num_rows:
        yield _contradiction(name, "other columns or another number of rows")
        return
    rows = {key: one[key].to_pylist() for key in ("unit", "quantity") if key in one.column_names}
    for about in one.schema:
        values = [one[about.name].to_pylist(), other[about.name].to_pylist()]
        place = f"{name}: {about.name}"
        if not one.schema.field(about.name).equals(other.schema.field(about.name)):
            yield _contradiction(place, "another type")
        elif str(about.type) not in ("double", "float"):
            yield from _of_exact(place, *values)
        else:
            unit = (about.metadata or {}).get(b"unit", b"").decode()
            units = rows.get("unit", []) if unit == "see unit" else [unit] * one.num_rows
            yield from _of_numbers(place, *values, units, rows.get("quantity", []))
    if DIRECTION in rows.get("quantity", []):
        sizes = abs(_projection(one) - _projection(other))
        allowed = PROJECTION.holds(0.0, float(sizes.max()))
        words = "" if allowed else f"{DIRECTION}: other ones by {sizes.max():.3g}"
        yield Difference(f"{name}: {DIRECTION}", "1", float(sizes.max()), allowed, words)


def _projection(table: pa.Table) -> np.ndarray:
    """On what the undetermined directions of a fit span, in mm and mrad."""
    found = table.filter(pc.equal(table["quantity"], DIRECTION)).to_pydict()
    names = {name: place for place, name in enumerate(dict.fromkeys(found["parameter"]))}
    rows = np.zeros((max(found["number"]), len(names)))
    for number, name, value in zip(
        found["number"], found["parameter"], found["value"], strict=True
    ):
        rows[number - 1, names[name]] = value
    return rows.T @ rows


def _of_exact(place: str, one: Sequence, other: Sequence) -> Iterator[Difference]:
    """Whole numbers, words and verdicts."""
    apart = [(a, b) for a, b in zip(one, other, strict=True) if a != b]
    if apart:
        yield _contradiction(place, f"{len(apart)} cells, such as {apart[0][0]} and {apart[0][1]}")


def _of_numbers(
    place: str, one: Sequence, other: Sequence, units: Sequence, quantities: Sequence
) -> Iterator[Difference]:
    """The largest difference for each unit, and every one above its tolerance."""
    largest: dict[str, float] = {}
    for row, (a, b) in enumerate(zip(one, other, strict=True)):
        if a == b or (a is not None and b is not None and math.isnan(a) and math.isnan(b)):
            continue
        if a is None or b is None or not (math.isfinite(a) and math.isfinite(b)):
            yield _contradiction(place, f"row {row}: {a} and {b}")
            continue
        quantity = quantities[row] if quantities else ""
        if quantity in (GAP, DIRECTION):
            continue
        of_unit = TOLERANCES.get(units[row], OTHERWISE)
        tolerance = OF_QUANTITIES.get(quantity, of_unit)
        if not tolerance.holds(a, b):
            yield Difference(place, units[row], abs(a - b), False, f"row {row}: {a!r} and {b!r}")
        elif units[row] in TOLERANCES and quantity not in OF_QUANTITIES:
            largest[units[row]] = max(largest.get(units[row], 0.0), abs(a - b))
        else:
            share = abs(a - b) / max(abs(a), tolerance.absolute / OTHERWISE.relative)
            largest["others"] = max(largest.get("others", 0.0), share)
    for unit, size in largest.items():
        yield Difference(place, unit, size, True)


def _contradiction(place: str, words: str) -> Difference:
    return Difference(place, "", math.inf, False, words)


# --- environments ---------------------------------------------------------------------------------


def lower_bounds() -> dict[str, str]:
    """What pyproject.toml states as the oldest version of each package that has one."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    found = (re.fullmatch(r"([\w-]+) *>= *([\d.]+)", each) for each in project["dependencies"])
    return {each[1]: each[2] for each in found if each}


def wanted(packages: str) -> tuple[list[str], str]:
    """Options of ``uv pip install``, and the requirements it reads."""
    locked = ROOT / "requirements" / "run.txt"
    if packages == "locked":
        return ["--require-hashes", "-r", str(locked)], ""
    names = re.findall(r"^[\w-]+", (ROOT / "requirements" / "run.in").read_text("utf-8"), re.M)
    if packages == "newest":
        return ["--upgrade", "-r", "-"], "\n".join(names)
    versions = dict(re.findall(r"^([\w.-]+)==([^\s;\\]+)", locked.read_text("utf-8"), re.M))
    bounds = lower_bounds()
    lines = [f"{n}>={bounds[n]}" if n in MATTERS else f"{n}=={versions[n]}" for n in names]
    # The oldest that is ready to install: older ones would have to be built for a newer Python.
    ready = [f"--only-binary={each}" for each in (*MATTERS, "llvmlite", "contourpy")]
    return ["--resolution", "lowest-direct", *ready, "-r", "-"], "\n".join(lines)


def made(folder: Path, environment: Environment) -> Path:
    """The environment's Python, made where it is not there."""
    place = folder / f"{environment.packages}-{environment.python}"
    python = place / "bin" / "python"
    if not (place / "made").exists():
        run([UV, "venv", "--quiet", "--clear", "--python", environment.python, str(place)])
        options, text = wanted(environment.packages)
        run([UV, "pip", "install", "--quiet", "--python", str(python), *options], text)
        (place / "made").touch()
    return python


def results_of(folder: Path, environment: Environment) -> Path:
    """Its results folder, run where it has not been."""
    place = folder / "runs" / environment.name
    finished = place / "versions.json"
    if not finished.exists():
        python = made(folder, environment)
        place.mkdir(parents=True, exist_ok=True)
        settings = {
            "PYTHONPATH": str(ROOT / "src"),
            "NUMBA_CACHE_DIR": str(folder / "compiled" / environment.name),
            **environment.variables,
        }
        configs = [str(ROOT / "config.yaml"), str(measured(place / "measured.yaml"))]
        run([str(python), __file__, "--stages", str(place / "results"), *configs], **settings)
        asked = "import json, sys, importlib.metadata as m\n"
        asked += "print(json.dumps({n: m.version(n) for n in sys.argv[1:]} "
        asked += "| {'python': sys.version.split()[0]}))"
        finished.write_text(run([str(python), "-c", asked, *MATTERS]), encoding="utf-8")
    return place


def every_stage(results: str, configs: list[str]) -> None:
    """Go through all stages, figures and pages too, in this process."""
    from kinacc.workflow.plan import planned
    from kinacc.workflow.runner import perform

    plan = planned(configs, results=results)
    for dataset in plan.datasets:
        for stage in plan.stages(dataset).values():
            for part in [] if stage.on_request else plan.part_names(stage.name, dataset):
                perform(plan.job(stage.name, dataset, part))


def measured(path: Path) -> Path:
    """A configuration of the measured arm alone, written there."""
    example, name = MEASURED
    dataset = yaml.safe_load((ROOT / example).read_text("utf-8"))["datasets"][name]
    file = dataset["measurements"]["file"]
    file["path"] = str(ROOT / Path(example).parent / file["path"])
    config = {"datasets": {name: dataset}, "figures": {"formats": ["svg"]}}
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    return path


def run(command: list[str], text: str = "", **variables: str) -> str:
    """What a command prints. Raises Failed."""
    print(" ".join(command[:6]), "..", file=sys.stderr)
    done = subprocess.run(
        command, input=text, env=os.environ | variables, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise Failed(f"{' '.join(command)}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}")
    return done.stdout


# --- the page -------------------------------------------------------------------------------------

UNITS = ("mm", "mrad", "rad", "1", "mm^2", "others")


def table(folder: Path) -> list[str]:
    """Lines of the table of environments that were run, beside the first."""
    head = ["environment", "Python", *MATTERS, *("share" if u == "1" else u for u in UNITS)]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for environment in ENVIRONMENTS:
        place = folder / "runs" / environment.name
        if not (place / "versions.json").exists():
            continue
        versions = json.loads((place / "versions.json").read_text("utf-8"))
        cells = [environment.name, versions["python"], *(versions[name] for name in MATTERS)]
        if environment is REFERENCE:
            cells += ["held to"] + [""] * (len(UNITS) - 1)
        else:
            found = [*differences(folder / "runs" / REFERENCE.name / "results", place / "results")]
            assert all(each.allowed for each in found), found
            sizes = [max((d.size for d in found if d.unit == u), default=0.0) for u in UNITS]
            cells += [f"{size:.1e}" if size else "0" for size in sizes]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def compared(first: Path, second: Path, name: str) -> int:
    """Print what differs between two results folders; the exit code."""
    found = [*differences(first, second)]
    for each in found:
        if not each.allowed:
            print(f"{name}: {each.place}: {each.words}")
    for unit in UNITS:
        worst = max((d for d in found if d.unit == unit), key=lambda d: d.size, default=None)
        if worst:
            print(f"{name}: {unit}: {worst.size:.1e} at most, in {worst.place}")
    return 0 if all(each.allowed for each in found) else 1


def written(folder: Path) -> None:
    """Put the table between the marks of the page."""
    begin, end = "<!-- environments -->\n", "<!-- end of environments -->"
    before, _, rest = PAGE.read_text("utf-8").partition(begin)
    after = rest.partition(end)[2]
    PAGE.write_text(before + begin + "\n".join(table(folder)) + "\n" + end + after, "utf-8")


def main(arguments: list[str]) -> int:
    """The exit code."""
    names = {each.name: each for each in ENVIRONMENTS}
    if arguments[:1] == ["--compare"] and len(arguments) == 3:
        return compared(Path(arguments[1]), Path(arguments[2]), "these")
    if arguments[:1] == ["--stages"]:
        every_stage(arguments[1], arguments[2:])
        return 0
    if not arguments or arguments[0].startswith("-") or {*arguments[1:]} - {*names}:
        print(__doc__, "Environments:", ", ".join(names), file=sys.stderr)
        return 2
    folder = Path(arguments[0]).resolve()
    reference = results_of(folder, REFERENCE) / "results"
    worst = 0
    for name in arguments[1:] or names:
        try:
            other = results_of(folder, names[name]) / "results"
        except Failed as failed:  # the others are told all the same
            print(f"{name}: {failed}")
            worst = 1
        else:
            worst = max(worst, compared(reference, other, name) if name != REFERENCE.name else 0)
    if not worst:
        written(folder)
    return worst


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
