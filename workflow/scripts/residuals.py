"""Comparing models and measurements, cross-validated (Tables I and III)."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.residuals",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} residuals",
        log=snakemake.log[0],
    )
)
