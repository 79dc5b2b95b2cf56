"""Drawing Fig. 3, the accuracy maps."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.fig3",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} fig3",
        log=snakemake.log[0],
    )
)
