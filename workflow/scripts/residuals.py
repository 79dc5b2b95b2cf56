"""Compare models and measurements, at held-out poses too (Tables I and III)."""

from kinacc.calibration import residual_tables
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(residual_tables.run(job.inputs, job.settings, progress=job.progress))
