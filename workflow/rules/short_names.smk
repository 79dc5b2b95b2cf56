# One stage of one data set by a short name: snakemake -c1 mh180_dh.

# Every rule makes planning slower, so that of many data sets a name is there where it is asked for,
# and all are where they are to be listed, which plans nothing.
asked = None
if len(plan.datasets) > 20 and not any(
    word in ("-l", "--lt") or word.startswith("--list") for word in sys.argv
):
    asked = [word for word in sys.argv if not word.endswith(".yaml")]

for dataset in plan.datasets:
    for name, stage in plan.stages(dataset).items():
        short = f"{dataset}_{name}"
        if stage.scattered or asked is not None and not any(word.endswith(short) for word in asked):
            continue

        rule:
            name:
                short
            input:
                list(plan.outputs(name, dataset).values()),
            message:
                f"{dataset}: {name} is up to date"

        listed_as(stage.message)
