"""What is wrong with a measured file."""

from kinacc.checks import check
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(check.run(job.inputs, job.settings))
