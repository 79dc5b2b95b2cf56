"""Fit the VEC model to the training poses (eqs. 5 and 6)."""

from kinacc.calibration import stages
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(stages.fit_model(job.inputs, job.settings, kind="vec", progress=job.progress))
