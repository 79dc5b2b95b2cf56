"""Hold the paper's numbers and sentences to the results."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import claims

with stage(snakemake) as job:
    job.write_tables(claims.run(job.inputs, job.settings))
