# One rule for every stage of the catalogue: what it reads, leaves and depends on stands there.

# With one data set its name stands in the paths, so that `snakemake -c1 dh` says which one it means.
whose = "{dataset}" if len(plan.datasets) > 1 else next(iter(plan.datasets))

# Only there limits are worked out for every job: each such question makes planning slower.
on_a_cluster = workflow.resource_settings.nodes or workflow.remote_exec

environment = "../envs/kinacc.yaml"
# Snakemake takes braces in the name of a folder for wildcards.
if not {"{", "}"}.isdisjoint(here := str(workflow.current_basedir)):
    environment = re.sub(r"([{}])", r"\1\1", os.path.join(here, environment))

gone_through = {name for dataset in plan.datasets for name in plan.stages(dataset)}

for stage in STAGES.values():
    if stage.name not in gone_through:
        continue
    part = "{part}" if stage.scattered else None

    rule:
        name:
            stage.name
        input:
            unpack(
                lambda w, name=stage.name, folder=whose: files_read(
                    name, w.get("dataset", folder), w.get("part")
                )
            ),
        output:
            **{
                role: (
                    path
                    if role in plan.formats[1:] or stage.scattered
                    else report(
                        path,
                        caption="../report/made.rst",
                        category=whose,
                        subcategory=stage.leaves,
                        labels={"file": os.path.basename(path), "step": stage.message},
                    )
                )
                for role, path in plan.outputs(stage.name, whose, part).items()
            },
            record=plan.record(stage.name, whose, part),
        log:
            plan.log(stage.name, whose, part),
        cache: stage.shared and workflow.enable_cache
        # What most waits for goes first, figures last: fewer cores are idle at the end.
        priority: stages_below(stage.name)
        # On a cluster stages of a data set share a job, and inside it start without further ado.
        group:
            (
                lambda w, name=stage.name, folder=whose: cluster.group(
                    plan, name, w.get("dataset", folder)
                )
            )
            if on_a_cluster and not workflow.remote_exec
            else None
        localrule: workflow.remote_exec
        conda:
            environment
        resources:
            mem_mb=(
                (lambda w, attempt, name=stage.name: cluster.memory_mb(name, attempt))
                if on_a_cluster
                else cluster.memory_mb(stage.name, 1)
            ),
            runtime=(
                (
                    lambda w, attempt, name=stage.name, folder=whose: cluster.runtime_min(
                        plan, name, w.get("dataset", folder), attempt
                    )
                )
                if on_a_cluster
                else 0
            ),
        # The content of files is a parameter, so that one copied here with an old date is noticed.
        params:
            job=lambda w, name=stage.name, folder=whose: plan.job_text(
                name, w.get("dataset", folder), w.get("part"), with_robustness()
            ),
            contents=lambda w, name=stage.name, folder=whose: plan.contents(
                name, w.get("dataset", folder)
            ),
            label=label(stage.name, whose, part),
        message:
            plan.message(stage.name, whose)
        shell:
            COMMAND

    listed_as(stage.message)


rule robustness:
    """the whole study, and the claims on further draws, whose shares go into claims.parquet"""
    input:
        [plan.targets(dataset, also=["robustness_table"]) for dataset in plan.datasets],
    message:
        "every table and figure is up to date, and robustness.parquet with the claims on further draws"
