"""Simulate the assessors under noise, a part of the repetitions."""

from kinacc.study import monte_carlo
from kinacc.workflow.script import part_of, stage

with stage(snakemake) as job:
    settings = {**job.settings, "part": part_of(snakemake)}
    job.write_tables(monte_carlo.simulated(job.inputs, settings))
