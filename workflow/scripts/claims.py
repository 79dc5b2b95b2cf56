"""Holding the paper's numbers and sentences to the results."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.claims",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} claims",
        log=snakemake.log[0],
    )
)
