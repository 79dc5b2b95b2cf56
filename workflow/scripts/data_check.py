"""What is wrong with a measured file."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import data_check

with stage(snakemake) as job:
    job.write_tables(data_check.run(job.inputs, job.settings, progress=job.progress))
