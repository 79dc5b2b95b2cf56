"""Claims on further draws of the synthetic arm, a part of the draws."""

from kinacc.study import robustness
from kinacc.workflow.script import part_of, stage

with stage(snakemake) as job:
    settings = {**job.settings, "part": part_of(snakemake)}
    job.write_tables(robustness.run(job.inputs, settings))
