"""Gather the parts of the study and sum them up (Fig. 4)."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import study

with stage(snakemake) as job:
    job.write_tables(study.run(job.inputs, job.settings))
