"""Gather the claims on further draws of the synthetic arm."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import robustness_table

with stage(snakemake) as job:
    job.write_tables(robustness_table.run(job.inputs, job.settings))
