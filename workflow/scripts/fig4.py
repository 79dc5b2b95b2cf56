"""Drawing Fig. 4, assessed accuracy against noise."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.fig4",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} fig4",
        log=snakemake.log[0],
    )
)
