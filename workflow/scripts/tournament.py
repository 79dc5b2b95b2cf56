"""Gathering the cells of the tournament and judging every assessor."""

from kinacc.workflow.runner import Job, execute

execute(
    Job(
        "kinacc.workflow.stages.tournament_tables",
        inputs=snakemake.params.inputs,
        outputs=snakemake.params.outputs,
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label="tournament",
        log=snakemake.log[0],
    )
)
