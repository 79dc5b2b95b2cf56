"""Measured poses: read from a file, or simulated with the paper's synthetic arm."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import measurements

with stage(snakemake) as job:
    job.write_tables(measurements.run(job.inputs, job.settings))
