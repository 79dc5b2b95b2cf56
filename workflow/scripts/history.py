"""Hold the calibrations of a series to one another, and draw what became of the arm."""

from kinacc.campaign.of_calibration import history
from kinacc.figures import history_over_time, save
from kinacc.tables import store
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    made = history(job.inputs, job.settings)
    start = "history_over_time_"
    formats = [each.removeprefix(start) for each in job.outputs if each.startswith(start)]
    table = store.to_table("history", made, job.marks())
    figure = history_over_time.draw(store.columns_in(table), dataset=job.dataset)
    pictures = {f"{start}{kind}": each for kind, each in save.render(figure, formats).items()}
    job.write_files({"history": store.content_of(table), **pictures})
