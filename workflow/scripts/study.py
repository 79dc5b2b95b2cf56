"""Gathering the simulations and summing them up (Fig. 4)."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.study",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} study",
        log=snakemake.log[0],
    )
)
