"""Saying how far off the excluded rows are."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.excluded_rows",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} excluded_rows",
        log=snakemake.log[0],
    )
)
