"""Fit the DH model with joints that bend under gravity."""

from kinacc.calibration import error_model
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(
        error_model.run(job.inputs, job.settings, kind="compliance", progress=job.progress)
    )
