"""Follow single model invalidations step by step (Figs. 5 and 6)."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import histories

with stage(snakemake) as job:
    job.write_tables(histories.run(job.inputs, job.settings, progress=job.progress))
