"""Map the largest error over the slices of the evaluation space (Fig. 3)."""

from kinacc.study import evaluation
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(evaluation.mapped(job.inputs, job.settings))
