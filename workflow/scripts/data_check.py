"""What is wrong with a measured file."""

from kinacc.checks import data_check
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(data_check.run(job.inputs, job.settings, progress=job.progress))
