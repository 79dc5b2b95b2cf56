"""Write the page that shows what the results of a data set are worth."""

from kinacc.report.page import html
from kinacc.workflow.script import stage
from kinacc.workflow.stages import report

with stage(snakemake) as job:
    page = report.run(job.inputs, {"dataset": job.dataset, "folder": str(job.folder)})
    job.write_files({"html": html(page, job.marks()).encode()})
