# From measured poses to the VEC and DH models and their residuals.


# The content of files is a parameter, so that one copied here with an old date is noticed as well.
rule measurements:
    input:
        unpack(lambda w: plan.inputs("measurements", w.dataset)),
    output:
        **plan.outputs("measurements", "{dataset}"),
    log:
        plan.log("measurements", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("measurements"),
        contents=lambda w: plan.contents("measurements", w.dataset),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("measurements", w.dataset),
    message:
        plan.message("measurements")
    script:
        "../scripts/measurements.py"


rule vec:
    input:
        unpack(lambda w: plan.inputs("vec", w.dataset)),
    output:
        **plan.outputs("vec", "{dataset}"),
    log:
        plan.log("vec", "{dataset}"),
    cache: True
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("vec"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("vec", w.dataset),
    message:
        plan.message("vec")
    script:
        "../scripts/vec.py"


rule dh:
    input:
        unpack(lambda w: plan.inputs("dh", w.dataset)),
    output:
        **plan.outputs("dh", "{dataset}"),
    log:
        plan.log("dh", "{dataset}"),
    cache: True
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("dh"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("dh", w.dataset),
    message:
        plan.message("dh")
    script:
        "../scripts/dh.py"


rule residuals:
    input:
        unpack(lambda w: plan.inputs("residuals", w.dataset)),
    output:
        **plan.outputs("residuals", "{dataset}"),
    log:
        plan.log("residuals", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("residuals"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("residuals", w.dataset),
    message:
        plan.message("residuals")
    script:
        "../scripts/residuals.py"
