"""Map the largest error over the slices of the evaluation space (Fig. 3)."""

from kinacc.workflow.script import stage
from kinacc.workflow.stages import accuracy_map

with stage(snakemake) as job:
    job.write_tables(accuracy_map.run(job.inputs, job.settings))
