# The paper's claims, and whether they hold for other draws of the arm.


rule claims:
    input:
        unpack(lambda w: plan.inputs("claims", w.dataset)),
    output:
        **plan.outputs("claims", "{dataset}"),
    log:
        plan.log("claims", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("claims"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("claims", w.dataset),
    message:
        plan.message("claims")
    script:
        "../scripts/claims.py"


rule robustness_chunk:
    input:
        unpack(lambda w: plan.inputs("robustness_chunk", w.dataset)),
    output:
        **plan.outputs("robustness_chunk", "{dataset}", "{part}"),
    log:
        plan.log("robustness_chunk", "{dataset}", "{part}"),
    cache: True
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("robustness_chunk"),
        part="{part}",
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("robustness_chunk", w.dataset),
    message:
        plan.message("robustness_chunk")
    script:
        "../scripts/robustness_chunk.py"


rule robustness_table:
    input:
        unpack(lambda w: plan.inputs("robustness_table", w.dataset)),
    output:
        **plan.outputs("robustness_table", "{dataset}"),
    log:
        plan.log("robustness_table", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("robustness_table"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("robustness_table", w.dataset),
    message:
        plan.message("robustness_table")
    script:
        "../scripts/robustness_table.py"


# Once robustness.parquet is there, the next plain run takes its shares into claims.parquet.
rule robustness:
    input:
        [plan.targets(dataset, on_request=True) for dataset in plan.datasets],
    message:
        "how often each claim holds on further draws of the arm is in robustness.parquet"
