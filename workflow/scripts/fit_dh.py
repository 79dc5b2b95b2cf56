"""Fit the DH model (Table II)."""

from kinacc.calibration import error_model
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(error_model.run(job.inputs, job.settings, kind="dh", progress=job.progress))
