# One rule for every stage of the catalogue: what it reads, leaves and depends on stands there.

for stage in STAGES.values():
    part = "{part}" if stage.scattered else None
    folder = TOURNAMENT if stage.joint else "{dataset}"

    # What has to be there and is not read is `ancient`: a stage is not made anew when that is.
    rule:
        name:
            stage.name
        input:
            ancient(lambda w, name=stage.name: plan.gates(name, w.get("dataset", TOURNAMENT))),
            unpack(
                lambda w, name=stage.name: plan.inputs(
                    name,
                    w.get("dataset", TOURNAMENT),
                    # Asked here: the targets are not known yet when this file is read.
                    on_request="robustness" in workflow.dag_settings.targets,
                )
            ),
        output:
            **plan.outputs(stage.name, folder, part),
        log:
            plan.log(stage.name, folder, part),
        cache: stage.shared
        conda:
            "../envs/kinacc.yaml"
        # The content of files is a parameter, so that one copied here with an old date is noticed.
        params:
            stage=stage.name,
            code=lambda w, name=stage.name: plan.code(name, w.get("dataset", TOURNAMENT)),
            part=part,
            label=lambda w, name=stage.name: label(
                name, w.get("dataset", TOURNAMENT), w.get("part")
            ),
            contents=lambda w, name=stage.name: plan.contents(name, w.get("dataset", TOURNAMENT)),
            seed=lambda w: plan.seed(w.get("dataset", TOURNAMENT)),
            settings=lambda w, name=stage.name: plan.settings(name, w.get("dataset", TOURNAMENT)),
        message:
            plan.message(stage.name)
        script:
            "../scripts/stage.py"


# The whole study and the claims on further draws, whose shares go into claims.parquet.
rule robustness:
    input:
        [plan.targets(dataset, on_request=True) for dataset in plan.datasets],
    message:
        "every table and figure is up to date, and robustness.parquet with the claims on further draws"


rule tournament:
    input:
        list(plan.outputs("tournament_tables", TOURNAMENT).values()),
    message:
        "the verdicts on every assessor are in tournament_verdicts.parquet"
