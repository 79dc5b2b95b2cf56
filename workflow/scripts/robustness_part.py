"""Claims on further draws of the synthetic arm, a part of the draws."""

from kinacc.workflow.script import part_of, stage
from kinacc.workflow.stages import robustness_chunk

with stage(snakemake) as job:
    settings = {**job.settings, "part": part_of(snakemake)}
    job.write_tables(robustness_chunk.run(job.inputs, settings, progress=job.progress))
