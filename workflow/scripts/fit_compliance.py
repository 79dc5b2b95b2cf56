"""Fit the DH model with joints that bend under gravity."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import error_model

with stage(snakemake) as job:
    job.write_tables(
        error_model.run(job.inputs, job.settings, kind="compliance", progress=job.progress)
    )
