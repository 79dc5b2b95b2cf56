"""How long does the work of stages take, once they have started?

The paper's own size, tables in memory. Limits:

- ``ablation``: Model Invalidation under twelve readings of the paper. ``from_above`` follows 3 to
  20 different paths a simulation, ``from_below`` 25 to 220, as every bound below its answer has to
  be shown to be rejected and they part at nearly every one; a path costs 2 to 5 us, a fourth of
  the single run it stands for. Fewer paths would be another answer
- ``residual tables``: five refits of both models, which is what ``fits`` and ``orders`` measure
- ``map``: the inverse of 5,600 poses in two turns, which is what ``kinematics`` measures
- ``picture``: the drawing itself, which matplotlib does in Python, once for each format; of a
  PDF as much again is cutting its fonts to the letters used
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import project
from harness import TODAY, Contender, Work

NOTES = {
    "ablation, all readings": "two thirds of the time are `from_below`, a path at a time as the"
    " limit says; readings of one point are drawn and averaged once for all twelve, probabilities"
    " far from the threshold come from a table. Certificates that a piece of bounds stays rejected"
    " (one point alone, its readings to the end) were tried and save nothing: at high noise no"
    " point decides alone.",
    "Fig. 1 as PDF": "every format is drawn once; fonts are cut without their rules for setting"
    " text. What is left is matplotlib's drawing in Python.",
}
NOISE_MM = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)


def ablation(smoke: bool) -> Callable[[], list[np.ndarray]]:
    """Every assessor under every reading, at every noise of the paper."""
    from kinacc.config.records import of_section
    from kinacc.config.schema import defaults
    from kinacc.study.monte_carlo import StudySettings, assessors, simulate

    section = defaults()["study"] | ({"measurements": 20} if smoke else {})
    random = np.random.default_rng(0)
    points = section["measurements"]
    error_mm = random.normal(size=(points, 3))
    error_mm *= (random.gamma(5.36, 1.0, points) / np.linalg.norm(error_mm, axis=1))[:, None]
    error_mm *= 0.906 / np.linalg.norm(error_mm, axis=1).max()
    every, visits = assessors(section), of_section(StudySettings, section)
    many = range(_simulations(smoke))
    return lambda: _numbers(simulate(error_mm, NOISE_MM, many, visits, 1, every))


def residual_tables(smoke: bool) -> Callable[[], list[np.ndarray]]:
    """The tables of errors in sample and held out, from the fits of the synthetic arm."""
    from kinacc.workflow import in_memory

    config = _config(smoke)
    fitted = in_memory.run(("measurements", "vec", "dh"), config, {})
    return lambda: _tables(in_memory.RUNS["residuals"](fitted, config))


def accuracy_map(smoke: bool) -> Callable[[], list[np.ndarray]]:
    """The map of Fig. 3."""
    from kinacc.workflow import in_memory

    config = _config(smoke)
    fitted = in_memory.run(("measurements", "vec", "dh"), config, {})
    return lambda: _tables(in_memory.RUNS["accuracy_map"](fitted, config))


def svg(_: bool) -> Callable[[], bytes]:
    """Fig. 1 as SVG."""
    return _picture("svg")


def png(_: bool) -> Callable[[], bytes]:
    """Fig. 1 as PNG."""
    return _picture("png")


def pdf(_: bool) -> Callable[[], bytes]:
    """Fig. 1 as PDF."""
    return _picture("pdf")


def works(smoke: bool) -> list[Work]:
    """A work for each kind of stage."""
    import kinacc

    many = _simulations(smoke) * len(NOISE_MM)
    return [
        Work(
            name, unit, count, (Contender("kinacc", kinacc.__version__),), agree,
            {TODAY: wanted} if wanted else {}, today=make, seconds=12.0,
        )
        for name, unit, count, agree, wanted, make in (
            ("ablation, all readings", "simulation", many, _same_numbers, 5.0, ablation),
            ("residual tables", "stage", 1, _same_errors, 3.0, residual_tables),
            ("map of Fig. 3", "stage", 1, _same_errors, 3.0, accuracy_map),
            ("Fig. 1 as SVG", "picture", 1, _same_bytes, None, svg),
            ("Fig. 1 as PNG", "picture", 1, _same_bytes, None, png),
            ("Fig. 1 as PDF", "picture", 1, _pages, None, pdf),
        )
    ]  # fmt: skip


def _picture(kind: str) -> Callable[[], bytes]:
    from kinacc.figures import fig1, save

    return lambda: save.render(fig1.draw(), [kind])[kind]


def _simulations(smoke: bool) -> int:
    return 1 if smoke else 4


@functools.cache
def _config(smoke: bool) -> Mapping:
    from kinacc.workflow.plan import planned

    config = planned([project.tree() / "config.yaml"]).datasets["mh180"]
    return {**config, "map": {**config["map"], "grid_mm": 200.0}} if smoke else config


def _tables(made: Mapping[str, Mapping[str, np.ndarray]]) -> list[np.ndarray]:
    return [column for table in made.values() for column in _numbers(table)]


def _numbers(table: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    """Its columns of numbers."""
    columns = (np.asarray(column) for column in table.values())
    return [column for column in columns if column.dtype.kind in "fiu"]


def _same_numbers(outputs: Sequence[list[np.ndarray]]) -> None:
    for other in outputs[1:]:
        for one, two in zip(outputs[0], other, strict=True):
            np.testing.assert_allclose(one, two, rtol=1e-5, atol=1e-8)


def _same_errors(outputs: Sequence[list[np.ndarray]]) -> None:
    """To 1e-5 mm and mrad: each kinacc has ended its own fits, to a share of their noise."""
    for other in outputs[1:]:
        for one, two in zip(outputs[0], other, strict=True):
            np.testing.assert_allclose(one, two, rtol=1e-5, atol=1e-5)


def _same_bytes(outputs: Sequence[bytes]) -> None:
    if len(set(outputs)) > 1:
        raise ValueError("the pictures have other bytes")


def _pages(outputs: Sequence[bytes]) -> None:
    """What is drawn, without the fonts, which carry no rules for setting text any more."""
    if {output[:5] for output in outputs} != {b"%PDF-"}:
        raise ValueError("not a PDF")
