"""Fit one model: VEC (eqs. 5 and 6), DH (Table II) or DH with joints that bend under gravity."""

from kinacc.calibration import stages
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    kind = snakemake.params.kind
    job.write_tables(stages.fit_model(job.inputs, job.settings, kind))
