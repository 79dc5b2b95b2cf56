"""Choose the operating points of the study and state their true errors."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import assessment_points

with stage(snakemake) as job:
    job.write_tables(assessment_points.run(job.inputs, job.settings))
