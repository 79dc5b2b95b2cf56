"""Sum up what the calibration is worth."""

from kinacc.report import summary
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(summary.run(job.inputs, job.settings))
