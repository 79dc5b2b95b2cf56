"""Measured poses: read from a file, or simulated with the paper's synthetic arm."""

from kinacc.synthetic import source
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(source.run(job.inputs, job.settings))
