"""Draw the figures that the outputs of the rule name."""

from kinacc.figures import save
from kinacc.figures.paper import draw_figure
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    settings = {**job.settings, "dataset": job.dataset}
    formats = {}
    for name, kind in (each.split("_") for each in job.outputs if each.startswith("fig")):
        formats.setdefault(name, []).append(kind)
    drawn = {}
    for name, kinds in formats.items():
        figure = draw_figure(name, job.inputs, settings)
        pictures = save.render(figure, kinds)
        drawn |= {f"{name}_{kind}": content for kind, content in pictures.items()}
    job.write_files(drawn)
