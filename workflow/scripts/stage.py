"""Run one stage of the catalogue for a job of the workflow."""

from kinacc.workflow.catalogue import STAGES
from kinacc.workflow.runner import Job, execute

stage, part = snakemake.params.stage, snakemake.params.get("part")
execute(
    Job(
        STAGES[stage].module,
        uses=STAGES[stage].used(snakemake.params.settings, snakemake.input.keys()),
        kind=STAGES[stage].fits,
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        part=part,
        label=snakemake.params.label,
        doing=snakemake.params.doing,
        log=snakemake.log[0],
    )
)
