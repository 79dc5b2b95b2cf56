"""Sum up what the calibration is worth."""

from kinacc.report import summarise
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(summarise.run(job.inputs, job.settings))
