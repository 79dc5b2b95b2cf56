"""Fit the VEC model to the training poses (eqs. 5 and 6)."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import error_model

with stage(snakemake) as job:
    job.write_tables(error_model.run(job.inputs, job.settings, kind="vec", progress=job.progress))
