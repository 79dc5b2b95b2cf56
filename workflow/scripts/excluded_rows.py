"""Errors of the rows that the configuration excludes."""

from kinacc.calibration import stages
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(stages.excluded_rows(job.inputs, job.settings))
