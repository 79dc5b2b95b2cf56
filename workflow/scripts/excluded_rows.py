"""Errors of the rows that the configuration excludes."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import excluded_rows

with stage(snakemake) as job:
    job.write_tables(excluded_rows.run(job.inputs, job.settings))
