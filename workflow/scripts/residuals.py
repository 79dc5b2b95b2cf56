"""Compare models and measurements, at held-out poses too (Tables I and III)."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import residuals

with stage(snakemake) as job:
    job.write_tables(residuals.run(job.inputs, job.settings, progress=job.progress))
