"""Simulate the assessors under noise, a part of the repetitions."""

from kinacc.workflow.script import part_of, stage
from kinacc.workflow.stages import study_chunk

with stage(snakemake) as job:
    settings = {**job.settings, "part": part_of(snakemake)}
    job.write_tables(study_chunk.run(job.inputs, settings, progress=job.progress))
