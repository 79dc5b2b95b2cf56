"""Reading or synthesising the measured poses."""

from kinacc.stages.runner import Job, execute

execute(
    Job(
        "kinacc.stages.measurements",
        inputs=dict(snakemake.input.items()),
        outputs=dict(snakemake.output.items()),
        settings=snakemake.params.settings,
        seed=snakemake.params.seed,
        label=f"{snakemake.wildcards.dataset} measurements",
        log=snakemake.log[0],
    )
)
