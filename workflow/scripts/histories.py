"""Following single model invalidations step by step (Figs. 5 and 6)."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.histories",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} histories",
        log=snakemake.log[0],
    )
)
