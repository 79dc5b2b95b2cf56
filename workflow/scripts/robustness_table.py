"""Gather the claims on further draws of the synthetic arm."""

from kinacc.study import robustness
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(robustness.gathered(job.inputs, job.settings))
