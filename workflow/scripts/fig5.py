"""Drawing Fig. 5, a model that is invalidated."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.fig5",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} fig5",
        log=snakemake.log[0],
    )
)
