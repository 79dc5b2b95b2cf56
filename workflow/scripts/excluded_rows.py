"""Errors of the rows that the configuration excludes."""

from kinacc.calibration import excluded_rows
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(excluded_rows.run(job.inputs, job.settings))
