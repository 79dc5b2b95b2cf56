"""Fitting the volumetric error compensation (VEC) model to the training poses."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.vec",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} vec",
        log=snakemake.log[0],
    )
)
