"""Campaigns of every assessor in some of the tournament's cells."""

from kinacc.workflow.runner import Job, execute

execute(
    Job(
        "kinacc.workflow.stages.tournament_chunk",
        inputs=snakemake.params.inputs,
        outputs=snakemake.params.outputs,
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        part=snakemake.params.part,
        label=f"tournament {snakemake.wildcards.part}",
        log=snakemake.log[0],
    )
)
