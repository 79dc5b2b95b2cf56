"""Hold the paper's numbers and sentences to the results."""

from kinacc.study.claims.evaluate import table_of
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(table_of(job.inputs, job.settings))
