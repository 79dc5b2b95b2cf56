"""Fitting the DH model by least squares (Table II)."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.dh",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} dh",
        log=snakemake.log[0],
    )
)
