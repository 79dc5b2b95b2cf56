"""``kinacc tournament``: every assessor on every error field, judged against the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import click

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.output import Output, answers

if TYPE_CHECKING:
    from kinacc.workflow.cost import Cost


@click.command("tournament")
@option("--config", multiple=True, help="Configuration; may be repeated. [config.yaml]")
@option("--results", default="results", help="Results folder.")
@option(
    "--size",
    type=choice.values_of("tournament.size"),
    help="Minutes; hours for coverage, for other budgets or for readings that are not as stated "
    "(workshop); or days on a cluster. [configuration]",
)
@option("--parts", type=choice.values_of("tournament.chunks"),
        help="Number of parts. [configuration]")  # fmt: skip
@option("--part", help="Compute this part alone, e.g. 1-of-8, and gather nothing.")
@option("--assessor", multiple=True, help="Let only these take part; may be repeated.")
@option("--noise-mm", type=float, multiple=True, help="Simulate only this noise of the size.")
@option("--cores", type=click.IntRange(1, 1000), default=1, help="Parts at a time.")
@option("--times", is_flag=True, help="Also measure the time of a campaign of each.")
@answers("Print the verdicts as JSON.")
def tournament(config, results, size, parts, part, assessor, noise_mm, cores, times, out) -> None:
    """Let every assessor assess errors that are known, and hold what it says to the truth.

    The error fields are those of the configuration's data sets, whose tables have to be there
    already, and families of synthetic arms. Leaves tournament_cells, tournament_verdicts and
    tournament_fields in RESULTS/tournament. Parts that are there, made from the same inputs and
    code, are kept: Ctrl-C stops it at once, and started again, it goes on from them. The number of
    parts changes nothing in the results.

    \b
    Example:
      kinacc tournament --config config.yaml --config examples/ur10.yaml --cores 2
      kinacc tournament --size full --parts 200 --part 7-of-200
    """
    from kinacc.errors import InputError, Problem, refuse
    from kinacc.workflow.catalogue import TOURNAMENT
    from kinacc.workflow.plan import planned
    from kinacc.workflow.results_lock import running, sharing
    from kinacc.workflow.runner import execute

    plan = planned(config or ("config.yaml",), results=results)
    plan = plan.contest(size, parts, assessor, noise_mm)
    absent = plan.absent("tournament_chunk", TOURNAMENT)
    refuse(absent, "the tournament lacks tables of the data sets")
    names = plan.part_names("tournament_chunk", TOURNAMENT)
    if part is not None and part not in names:
        raise InputError(Problem("--part", repr(part), f"{names[0]} to {names[-1]}"))
    wanted = [part] if part else names
    waiting = [plan.job("tournament_chunk", TOURNAMENT, name) for name in wanted]
    with running(results) if part is None else sharing(results):
        _play(waiting, cores)
        if part is not None:
            return
        gathering = plan.job("tournament_tables", TOURNAMENT)
        execute(gathering, bar=True)
    _tell(gathering.outputs, _times(waiting[0]) if times else {}, out)


def _play(waiting: Sequence, cores: int) -> None:
    """Compute the parts that are not there yet."""
    from kinacc.workflow import cost
    from kinacc.workflow.local_executor import execute_all
    from kinacc.workflow.runner import is_done

    left = [job for job in waiting if not is_done(job)]
    for line in cost.expected({("", "tournament"): _cost(left)} if left else {}):
        click.echo(line, err=True)
    finished = len(waiting) - len(left)
    if finished:
        click.echo(f"{finished} of {len(waiting)} parts are there", err=True)
    try:
        for job in execute_all(left, cores):
            finished += 1
            if len(left) > 1 and cores > 1:
                click.echo(f"{job.label}: done, {finished} of {len(waiting)}", err=True)
    except KeyboardInterrupt:
        click.echo(
            f"tournament: {finished} of {len(waiting)} parts are done and kept; the same command "
            "goes on from there",
            err=True,
        )
        raise


def _cost(left: Sequence) -> Cost:
    """What the parts that are left cost, by the share of the tournament that they are."""
    from kinacc.study.tournament.contest import Contest
    from kinacc.workflow.cost import of_tournament

    settings = left[0].settings
    contest, whole = Contest.of(settings), Contest.of({**settings, "noise_mm": ()})
    share = len(contest.assessors) / len(whole.size.assessors)
    share *= len(contest.size.noise_mm) / len(whole.size.noise_mm)
    share *= len(left) / int(left[0].part.rpartition("-")[2])
    found = of_tournament(settings["size"])
    return found._replace(seconds=share * found.seconds)


def _times(job) -> dict[str, float]:
    """Milliseconds of a campaign by assessor; no table holds them, for they differ by the hour."""
    from kinacc.study.tournament.contest import Contest, jobs, times_ms
    from kinacc.study.tournament.fields import of_tables
    from kinacc.workflow.inputs import read_inputs

    fields = of_tables(read_inputs(job.inputs).tables, job.settings["robots"], ())
    contest = Contest.of(job.settings)
    work = jobs(fields, contest.size)
    cell = next((each for each in work if each.budget == 200), work[-1])
    return times_ms(cell, contest)


def _tell(outputs: Mapping[str, str], times: dict[str, float], out: Output) -> None:
    """Print the verdicts, and how statements fared whose assumption is not true of the field."""
    from kinacc.artifacts.store import read

    path = outputs["tournament_verdicts"]
    table = read(path)
    rows = [dict(zip(table, each, strict=True)) for each in zip(*_plain(table), strict=True)]
    rows.sort(key=lambda row: (row["setup"] != "plain", row["setup"], row["world"] != "stated"))
    cells = read(outputs["tournament_cells"])
    lines = [
        "assessor                 about       statements   held  worst cell  rejected  below  cells"
        "  no statement  assumption broken  held so"
    ]
    told = ""
    for row in rows:
        if (where := f"{row['setup']}: {row['world']}") != "plain: stated" and where != told:
            lines.append(f"settings and world {where}")
        told = where
        untrue, held = _untrue(cells, row)
        lines.append(
            f"{row['assessor']:23s}  {row['target']:10s}  {row['statements']:10d}  "
            f"{row['mean_holds']:5.3f}  {row['worst_holds']:10.3f}  {row['rejected']:8d}  "
            f"{row['below']:5d}  {row['cells']:5d}  {row['withheld']:12.1%}  {untrue:17d}  "
            + (f"{held / untrue:7.3f}" if untrue else f"{'-':>7s}")
        )
    lines.append(
        "held: share of upper bounds not below the truth; rejected: cells significantly below the "
        "confidence;\nbelow: cells more than 3 points below it; assumption broken: statements left "
        "out of all this because\nthe field breaks what they assume, which no reading showed; "
        "held so: share of these that held"
    )
    lines += [f"{n:24s}  {ms:8.1f} ms a campaign of 200 measurements" for n, ms in times.items()]
    lines.append(f"all of it: {path.rpartition('/')[0]}")
    out.say({"verdicts": rows, "time_ms": times, "table": path}, "\n".join(lines))


def _untrue(cells: Mapping, row: Mapping) -> tuple[int, int]:
    """Number of statements whose assumption is not true of the field, and how many of them held."""
    mine = cells["broken"] > 0
    for name in ("assessor", "target", "setup", "world"):
        mine = mine & (cells[name] == row[name])
    broken = cells["broken"][mine]
    return int(broken.sum()), round(float((cells["broken_holds"][mine] * broken).sum()))


def _plain(table) -> list[list]:
    return [column.tolist() for column in table.values()]
