"""Follow single model invalidations step by step (Figs. 5 and 6)."""

from kinacc.study import histories
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    job.write_tables(histories.run(job.inputs, job.settings))
