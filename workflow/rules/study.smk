# The Monte Carlo study of the assessors.


rule assessment_points:
    input:
        unpack(lambda w: plan.inputs("assessment_points", w.dataset)),
    output:
        **plan.outputs("assessment_points", "{dataset}"),
    log:
        plan.log("assessment_points", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("assessment_points"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("assessment_points", w.dataset),
    message:
        plan.message("assessment_points")
    script:
        "../scripts/assessment_points.py"


rule study_chunk:
    input:
        unpack(lambda w: plan.inputs("study_chunk", w.dataset)),
    output:
        **plan.outputs("study_chunk", "{dataset}", "{part}"),
    log:
        plan.log("study_chunk", "{dataset}", "{part}"),
    cache: True
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("study_chunk"),
        part="{part}",
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("study_chunk", w.dataset),
    message:
        plan.message("study_chunk")
    script:
        "../scripts/study_chunk.py"


rule study:
    input:
        unpack(lambda w: plan.inputs("study", w.dataset)),
    output:
        **plan.outputs("study", "{dataset}"),
    log:
        plan.log("study", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("study"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("study", w.dataset),
    message:
        plan.message("study")
    script:
        "../scripts/study.py"


rule histories:
    input:
        unpack(lambda w: plan.inputs("histories", w.dataset)),
    output:
        **plan.outputs("histories", "{dataset}"),
    log:
        plan.log("histories", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("histories"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("histories", w.dataset),
    message:
        plan.message("histories")
    script:
        "../scripts/histories.py"
