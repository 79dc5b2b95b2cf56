"""Drawing Fig. 1, the one-dimensional example."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.fig1",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} fig1",
        log=snakemake.log[0],
    )
)
