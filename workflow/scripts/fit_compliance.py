"""Fit the DH model with joints that bend under gravity."""

from kinacc.calibration import stages
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(
        stages.fit_model(job.inputs, job.settings, kind="compliance", progress=job.progress)
    )
