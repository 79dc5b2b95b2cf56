"""Drawing Fig. 6, a model that cannot be invalidated."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.fig6",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} fig6",
        log=snakemake.log[0],
    )
)
