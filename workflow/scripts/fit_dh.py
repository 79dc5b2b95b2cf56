"""Fit the DH model (Table II)."""

from kinacc.calibration import stages
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(stages.fit_model(job.inputs, job.settings, kind="dh", progress=job.progress))
