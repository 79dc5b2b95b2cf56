# One stage of one data set by a short name: snakemake -c1 mh180_dh.

# Twenty rules for each of a thousand data sets would take longer than all else that is planned:
# of many data sets only the names on the command line are made.
every = len(plan.datasets) <= 20

for dataset in plan.datasets:
    for name, stage in plan.stages(dataset).items():
        if not stage.scattered and (every or f"{dataset}_{name}" in sys.argv):

            rule:
                name:
                    f"{dataset}_{name}"
                input:
                    list(plan.outputs(name, dataset).values()),
                message:
                    f"{dataset}: {name} is up to date"
