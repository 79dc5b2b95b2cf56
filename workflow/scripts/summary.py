"""Sum up what the calibration is worth."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import summary

with stage(snakemake) as job:
    job.write_tables(summary.run(job.inputs, job.settings))
