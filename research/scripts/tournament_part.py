"""Summaries of the campaigns in every ``parts``-th job of the tournament."""

from kinacc.config.schema import defaults
from research.contest import SIZES, Contest, contested, jobs, summed

given, part = snakemake.params, int(snakemake.wildcards.part)
size = SIZES[given.size]
contest = Contest(size, given.seed, tuple(given.assessors) or size.assessors, defaults()["study"])
work = jobs(contested(given.folders, size), size)
summed(work[part :: given.parts], contest).to_parquet(snakemake.output[0])
