"""Choose the operating points of the study and state their true errors."""

from kinacc.study import evaluation
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(evaluation.points(job.inputs, job.settings))
