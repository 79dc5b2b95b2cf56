# The largest error over the slices of the evaluation space.


rule accuracy_map:
    input:
        unpack(lambda w: plan.inputs("accuracy_map", w.dataset)),
    output:
        **plan.outputs("accuracy_map", "{dataset}"),
    log:
        plan.log("accuracy_map", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("accuracy_map"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("accuracy_map", w.dataset),
    message:
        plan.message("accuracy_map")
    script:
        "../scripts/accuracy_map.py"
