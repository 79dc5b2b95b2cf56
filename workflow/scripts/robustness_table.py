"""Gathering the claims on further draws of the arm."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.robustness_table",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} robustness_table",
        log=snakemake.log[0],
    )
)
