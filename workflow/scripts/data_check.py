"""Checking the measured file before anything is fitted to it."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.data_check",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} data_check",
        log=snakemake.log[0],
    )
)
