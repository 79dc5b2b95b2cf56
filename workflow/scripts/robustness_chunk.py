"""Going through fits, study and claims with further draws of the arm."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.robustness_chunk",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        part=snakemake.params.part,
        label=f"{snakemake.wildcards.dataset} robustness_chunk {snakemake.params.part}",
        log=snakemake.log[0],
    )
)
