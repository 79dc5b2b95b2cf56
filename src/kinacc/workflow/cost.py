"""What work costs in time and memory, from the configuration, before it is begun.

Simple formulas by stage. Their constants were measured, on one core (`benchmarks/costs.py` holds
estimates to what is measured: within a factor of three); what decides is how work grows. Importing
this costs nothing but the standard library.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.workflow.catalogue import STAGES, TABLES

if TYPE_CHECKING:
    from kinacc.workflow.plan import Plan

LONG_S, LARGE_B = 60.0, 1e9  # what is said before it is begun
_PROCESS_B = 1e8  # Python, numpy and what they read
_READINGS = 16  # assessors with their readings of the paper
_JOINTS = 6
_BYTES_A_ROW = 80  # of a file of measurements
_TRIED = 12  # order, where it is chosen: the search ends where higher ones are no better
_SHORT_S = 1.0  # of a stage whose table is not looked into
_GROUPS = Path("/proc/self/cgroup")
_LIMITS = {
    "": (Path("/sys/fs/cgroup"), "memory.max"),
    "memory": (Path("/sys/fs/cgroup/memory"), "memory.limit_in_bytes"),
}


class Cost(NamedTuple):
    """Processor time and largest memory of some work, and the settings to lower for less of it."""

    seconds: float
    bytes: float
    keys: tuple[str, ...]

    @property
    def is_large(self) -> bool:
        """Whether it takes more than a minute or a gigabyte."""
        return self.seconds > LONG_S or self.bytes > LARGE_B


Config = Mapping[str, object]


def _at(config: Mapping, path: str):
    for key in path.split("."):
        config = config[key]
    return config


def _poses(config: Mapping) -> float:
    measurements = config["measurements"]
    if measurements["source"] == "synthetic":
        return measurements["synthetic"]["poses"]
    path = measurements["file"]["path"]
    return min(os.path.getsize(path) / _BYTES_A_ROW, 1e6) if os.path.isfile(path) else 0.0


def _fit_of_vec(config: Mapping) -> Cost:
    """One fit of a VEC model; where its order is chosen, of the highest that is tried as a rule."""
    poses, section = _poses(config), _at(config, "calibration.vec")
    chosen = section["order"] == "auto"
    order = min(section["order_highest"], _TRIED) if chosen else section["order"]
    unknowns = _JOINTS * _JOINTS * (order + 1)
    seconds = 0.06 + 2.9e-7 * poses * unknowns + 9.3e-10 * unknowns**3
    memory = _PROCESS_B + 40.0 * poses * unknowns + 90.0 * unknowns**2
    key = "calibration.vec.order_highest" if chosen else "calibration.vec.order"
    return Cost(seconds, memory, (key, *_of_poses(config)))


def _vec(config: Mapping) -> Cost:
    fit = _fit_of_vec(config)
    chosen = _at(config, "calibration.vec.order") == "auto"
    return fit._replace(seconds=0.4 + 3.0 * fit.seconds) if chosen else fit


def _of_poses(config: Mapping) -> tuple[str, ...]:
    synthetic = _at(config, "measurements.source") == "synthetic"
    return ("measurements.synthetic.poses",) if synthetic else ()


def _dh(config: Mapping) -> Cost:
    poses = _poses(config)
    return Cost(0.01 + 1.8e-5 * poses, _PROCESS_B + 7e3 * poses, _of_poses(config))


def _residuals(config: Mapping) -> Cost:
    folds, vec = _at(config, "measurements.folds") or 0, _fit_of_vec(config)
    seconds = 0.1 + folds * 0.7 * (vec.seconds + _dh(config).seconds)
    return Cost(seconds, vec.bytes, ("measurements.folds", *vec.keys))


def _history(config: Mapping) -> Cost:
    """Every line held to the one in force; of lines as long as the newest."""
    lines, poses = len(config.get("series", ())), _poses(config)
    return Cost(1.4e-3 * lines * poses, 4e8 + 6e4 * poses, ("series",))


def cells(config: Mapping) -> float:
    """Places of the grid of all slices of the map."""
    space, grid_mm = _at(config, "evaluation.cylinder"), _at(config, "map.grid_mm")
    sides = [space[key] / grid_mm + 1.0 for key in ("radial_span_mm", "height_mm")]
    return len(_at(config, "map.slices_deg")) * sides[0] * sides[1]


def _map(config: Mapping) -> Cost:
    turns = 27 if _at(config, "evaluation.rotations") == "all_27" else 9
    count = cells(config)
    seconds = 0.8 + 5.6e-6 * count * turns
    return Cost(seconds, 1.8e8 + 500.0 * count, ("map.grid_mm", "map.slices_deg"))


def _assessment_points(config: Mapping) -> Cost:
    count = _at(config, "evaluation.points")
    return Cost(0.01 + 1.5e-5 * count, _PROCESS_B, ("evaluation.points",))


def world_bytes(points: float, visits: float) -> float:
    """Memory of all readings that a simulation may take, of any point as many as of all."""
    return 32.0 * min(points, visits) * visits


def simulation_s(points: float, visits: float) -> float:
    """Processor time of one simulation under every reading of the paper."""
    return 8e-4 + 5e-6 * visits + 4.2e-12 * min(points, visits) * visits**2


def simulations(config: Mapping) -> float:
    """Simulations of the study, at all noises."""
    study = _at(config, "study")
    return len(study["noise_mm"]) * study["repetitions"]


def _study_chunk(config: Mapping) -> Cost:
    points, visits = _at(config, "evaluation.points"), _at(config, "study.measurements")
    count = simulations(config)
    seconds = count * simulation_s(points, visits)
    memory = 1.8e8 + world_bytes(points, visits) + 700.0 * _READINGS * count
    return Cost(seconds, memory, ("study.repetitions", "study.measurements", "evaluation.points"))


def _study(config: Mapping) -> Cost:
    rows = _READINGS * simulations(config)
    return Cost(1e-5 * rows, _PROCESS_B + 500.0 * rows, ("study.repetitions",))


def _histories(config: Mapping) -> Cost:
    points, visits = _at(config, "evaluation.points"), _at(config, "study.measurements")
    count = 2 * _at(config, "histories.simulations_searched")
    seconds = count * simulation_s(points, visits) / 50.0
    keys = ("histories.simulations_searched", "study.measurements", "evaluation.points")
    return Cost(seconds, 1.8e8 + 2.0 * world_bytes(points, visits), keys)


def _robustness(config: Mapping) -> Cost:
    inside = [each(config).bytes for each in (_vec, _map, _study_chunk)]
    return Cost(5.0 * _at(config, "robustness.draws"), max(inside), ("robustness.draws",))


_STAGES: Mapping[str, Callable[[Mapping], Cost]] = {
    "vec": _vec,
    "dh": _dh,
    "residuals": _residuals,
    "history": _history,
    "accuracy_map": _map,
    "assessment_points": _assessment_points,
    "study_chunk": _study_chunk,
    "study": _study,
    "histories": _histories,
}
_ON_REQUEST = {"robustness_chunk": _robustness}


def of_stage(name: str, config: Mapping) -> Cost:
    """What a stage of a data set costs, all of its parts together, by its full configuration."""
    of = {**_STAGES, **_ON_REQUEST}.get(name)
    return of(config) if of else Cost(0.0, 0.0, ())


def of_campaigns(points: int, budgets: Sequence[int], fields: int, repetitions: int) -> Cost:
    """What the simulated campaigns of plan-campaign cost, each of the budgets on each field."""
    count = fields * repetitions
    memory = _PROCESS_B + world_bytes(points, max(budgets)) + 1500.0 * count * len(budgets)
    return Cost(0.3 + 5e-5 * count * sum(budgets), memory, ("--repetitions", "--budget", "--poses"))


def of_chosen_poses(candidates: int, count: int) -> Cost:
    """What plan-poses costs."""
    memory = _PROCESS_B + 6e3 * candidates
    return Cost(0.1 + 1e-5 * candidates * count, memory, ("--drawn", "--candidates", "--poses"))


def foreseen(plan: Plan, only: Collection[str] = STAGES) -> dict[tuple[str, str], Cost]:
    """What is still to be made, by data set and stage of a plain run, where all is a lot of work.

    Empty where it takes neither a minute nor a gigabyte.
    """
    found = {
        (dataset, name): of_stage(name, config)
        for dataset, config in plan.datasets.items()
        for name in _STAGES
        if name in only
    }
    if not _is_large(found):
        return {}
    left = {
        (dataset, name): each
        for (dataset, name), each in found.items()
        if name in plan.stages(dataset) and not _is_there(plan, name, dataset, each)
    }
    return left if _is_large(left) else {}


def _is_large(found: Mapping[tuple[str, str], Cost]) -> bool:
    return sum(each.seconds for each in found.values()) > LONG_S or any(
        each.bytes > LARGE_B for each in found.values()
    )


def _is_there(plan: Plan, name: str, dataset: str, cost: Cost) -> bool:
    """Whether the tables of a stage are there, of these settings where it takes its time."""
    from kinacc.artifacts.provenance import config_hash
    from kinacc.artifacts.store import read_metadata

    paths = [
        path
        for part in plan.part_names(name, dataset)
        for path in plan.outputs(name, dataset, part).values()
    ]
    if STAGES[name].leaves != TABLES or not all(map(os.path.isfile, paths)):
        return False
    if cost.seconds < _SHORT_S:
        return True
    wanted = config_hash(plan.settings(name, dataset))
    try:
        return all(read_metadata(path).get("config_hash") == wanted for path in paths)
    except InputError:
        return False


def expected(found: Mapping[tuple[str, str], Cost], here: bool = True) -> list[str]:
    """What to say of work before it is begun: a line where it takes long or much memory.

    Raises InputError where it is done ``here``, and the memory of this machine cannot hold it.
    """
    if not _is_large(found):
        return []
    if here:
        refuse(_beyond(found), "There is not enough memory")
    seconds = sum(each.seconds for each in found.values())
    by_stage: dict[str, list[tuple[str, Cost]]] = {}
    for (dataset, name), each in found.items():
        by_stage.setdefault(name, []).append((dataset, each))
    long, large = seconds > LONG_S, max(each.bytes for each in found.values())

    def weight(name: str) -> float:
        costs = [each for _, each in by_stage[name]]
        return sum(e.seconds for e in costs) if long else max(e.bytes for e in costs)

    name = max(by_stage, key=weight)
    most = by_stage[name]
    several = f"{name} of {len(most):,} data sets"
    whose = several if len(most) > 1 else " ".join(filter(None, (most[0][0], name)))
    return [
        f"about {in_time(seconds)} of work on one core and {in_bytes(large)} of memory are ahead; "
        f"most for {whose}, by {first_few(most[0][1].keys)}"
    ]


def _beyond(found: Mapping[tuple[str, str], Cost]) -> list[Problem]:
    """A problem for all work that the memory of this machine cannot hold."""
    there = machine_bytes()
    return [
        Problem(
            " ".join(filter(None, key)),
            f"needs about {in_bytes(each.bytes)} of memory",
            f"{in_bytes(there)}, which is all there is here",
            f"lower {' or '.join(each.keys)}",
        )
        for key, each in found.items()
        if each.bytes > there
    ]


def in_time(seconds: float) -> str:
    """A time in words, in whole units."""
    for size, unit in ((86_400, "days"), (3_600, "h"), (60, "min")):
        if seconds >= 1.5 * size:
            return f"{seconds / size:,.0f} {unit}"
    return f"{seconds:.0f} s"


def in_bytes(count: float) -> str:
    """A size in words."""
    return f"{count / 1e9:,.1f} GB" if count >= 1e9 else f"{count / 1e6:.0f} MB"


def machine_bytes() -> float:
    """Memory that this process may have: of the machine, of its group, by its own limit."""
    limits = [float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE"), *_of_groups()]
    with suppress(ImportError, OSError):
        import resource

        own = resource.getrlimit(resource.RLIMIT_AS)[0]
        limits += [float(own)] if own != resource.RLIM_INFINITY else []
    return min(limits)


def _of_groups() -> Iterator[float]:
    """Limits of the control groups this process is in, as of a container or a job of a cluster."""
    try:
        groups = _GROUPS.read_text().splitlines()
    except OSError:
        return
    for line in groups:
        _, kinds, group = line.split(":", 2)
        if kinds and "memory" not in kinds.split(","):
            continue
        base, name = _LIMITS["memory" if kinds else ""]
        within = Path(group.lstrip("/"))
        for folder in (within, *within.parents):
            with suppress(OSError, ValueError):
                yield float(int((base / folder / name).read_text()))
