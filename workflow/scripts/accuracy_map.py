"""Mapping the largest error over the slices of the evaluation space (Fig. 3)."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.accuracy_map",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} accuracy_map",
        log=snakemake.log[0],
    )
)
