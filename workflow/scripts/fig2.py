"""Drawing Fig. 2, the arm over its evaluation space."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.fig2",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} fig2",
        log=snakemake.log[0],
    )
)
