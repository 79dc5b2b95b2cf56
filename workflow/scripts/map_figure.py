"""Draw Fig. 3, the accuracy maps."""

from kinacc.figures import fig3, save
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    formats = [each.removeprefix("fig3_") for each in job.outputs if each.startswith("fig3_")]
    pictures = save.render(fig3.run(job.inputs, {"dataset": job.dataset}), formats)
    job.write_files({f"fig3_{kind}": content for kind, content in pictures.items()})
