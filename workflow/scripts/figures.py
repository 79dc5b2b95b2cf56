"""Draw Figs. 1, 2, 4, 5 and 6."""

from kinacc.figures import fig1, fig2, fig4, fig5, fig6, save
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    settings = {**job.settings, "dataset": job.dataset}
    drawn = {}
    for module in (fig1, fig2, fig4, fig5, fig6):
        name = module.__name__.rpartition(".")[2]
        formats = [each.partition("_")[2] for each in job.outputs if each.startswith(f"{name}_")]
        pictures = save.render(module.run(job.inputs, settings), formats)
        drawn |= {f"{name}_{kind}": content for kind, content in pictures.items()}
    job.write_files(drawn)
