# One stage of one data set by a short name: snakemake -c1 mh180_dh.

for dataset in plan.datasets:
    for name, stage in plan.stages(dataset).items():
        if not stage.scattered:

            rule:
                name:
                    f"{dataset}_{name}"
                input:
                    list(plan.outputs(name, dataset).values()),
                message:
                    f"{dataset}: {name} is up to date"
