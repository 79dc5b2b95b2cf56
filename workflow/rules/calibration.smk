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


# What the check finds stops the fits, and its table is not read: `ancient`, so that they are not
# made anew when it is.
rule data_check:
    input:
        unpack(lambda w: plan.inputs("data_check", w.dataset)),
    output:
        **plan.outputs("data_check", "{dataset}"),
    log:
        plan.log("data_check", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("data_check"),
        contents=lambda w: plan.contents("data_check", w.dataset),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("data_check", w.dataset),
    message:
        plan.message("data_check")
    script:
        "../scripts/data_check.py"


rule vec:
    input:
        ancient(lambda w: plan.gates("vec", w.dataset)),
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


rule excluded_rows:
    input:
        unpack(lambda w: plan.inputs("excluded_rows", w.dataset)),
    output:
        **plan.outputs("excluded_rows", "{dataset}"),
    log:
        plan.log("excluded_rows", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("excluded_rows"),
        contents=lambda w: plan.contents("excluded_rows", w.dataset),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("excluded_rows", w.dataset),
    message:
        plan.message("excluded_rows")
    script:
        "../scripts/excluded_rows.py"
