"""Choosing the operating points of the study and their true errors."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.assessment_points",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} assessment_points",
        log=snakemake.log[0],
    )
)
