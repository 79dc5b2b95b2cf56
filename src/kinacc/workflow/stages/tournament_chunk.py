"""Stage: campaigns of every assessor in some of the tournament's cells."""

from __future__ import annotations

from collections.abc import Mapping

from kinacc.study.tournament import contest


def run(inputs: Mapping, settings: Mapping, progress=None) -> dict[str, dict]:
    """Return ``tournament_chunk`` for ``settings["part"]`` (default: everything).

    inputs: tables of the data sets, ``<data set>/<artefact>``. settings: ``seed``, ``size`` (a
    name of :data:`contest.SIZES`), ``assessors`` (all if empty),
    ``noise_mm`` (all of the size if empty), ``study`` (what assessors share with that section of
    the configuration) and, by data set, ``robots``.
    """
    given = contest.Contest.of(settings)
    fields = contest.contested(inputs, settings["robots"], given.size)
    part = settings.get("part") or {"number": 1, "of": 1}
    work = contest.part_of(contest.jobs(fields, given.size), part["number"], part["of"])
    return {"tournament_chunk": contest.summed(work, given, progress)}
