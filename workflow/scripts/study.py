"""Gather the parts of the study and sum them up (Fig. 4)."""

from kinacc.study import monte_carlo
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(monte_carlo.summed_up(job.inputs, job.settings))
