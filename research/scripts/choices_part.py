"""Every claim in one part of the runs; runs that share settings are in the same part."""

from kinacc.config.schema import defaults
from research.design import runs
from research.judged_runs import alike, judged

given, part = snakemake.params, int(snakemake.wildcards.part)
config = {"robot": "mh180", **defaults(), "choices": {"names": given.names, "runs": given.runs}}
ordered = alike(runs(config), config)
first, last = (len(ordered) * end // given.parts for end in (part, part + 1))
choices, factors = judged(ordered[first:last], config)
choices.to_parquet(snakemake.output.choices)
factors.to_parquet(snakemake.output.factors)
