"""Compare models and measurements, at held-out poses too (Tables I and III)."""

from kinacc.calibration import stages
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(stages.compare_models(job.inputs, job.settings))
