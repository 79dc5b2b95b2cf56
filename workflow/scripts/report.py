"""Write the page that shows what the results of a data set are worth."""

from kinacc.report import dataset
from kinacc.report.page import html
from kinacc.workflow.script import stage

with stage(snakemake) as job:
    page = dataset.run(job.inputs, str(job.folder))
    job.write_files({"html": html(page, job.marks()).encode()})
