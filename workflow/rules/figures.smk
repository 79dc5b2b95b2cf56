# Figures 1 to 6.


rule fig1:
    input:
        unpack(lambda w: plan.inputs("fig1", w.dataset)),
    output:
        **plan.outputs("fig1", "{dataset}"),
    log:
        plan.log("fig1", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("fig1"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("fig1", w.dataset),
    message:
        plan.message("fig1")
    script:
        "../scripts/fig1.py"


rule fig2:
    input:
        unpack(lambda w: plan.inputs("fig2", w.dataset)),
    output:
        **plan.outputs("fig2", "{dataset}"),
    log:
        plan.log("fig2", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("fig2"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("fig2", w.dataset),
    message:
        plan.message("fig2")
    script:
        "../scripts/fig2.py"


rule fig3:
    input:
        unpack(lambda w: plan.inputs("fig3", w.dataset)),
    output:
        **plan.outputs("fig3", "{dataset}"),
    log:
        plan.log("fig3", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("fig3"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("fig3", w.dataset),
    message:
        plan.message("fig3")
    script:
        "../scripts/fig3.py"


rule fig4:
    input:
        unpack(lambda w: plan.inputs("fig4", w.dataset)),
    output:
        **plan.outputs("fig4", "{dataset}"),
    log:
        plan.log("fig4", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("fig4"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("fig4", w.dataset),
    message:
        plan.message("fig4")
    script:
        "../scripts/fig4.py"


rule fig5:
    input:
        unpack(lambda w: plan.inputs("fig5", w.dataset)),
    output:
        **plan.outputs("fig5", "{dataset}"),
    log:
        plan.log("fig5", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("fig5"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("fig5", w.dataset),
    message:
        plan.message("fig5")
    script:
        "../scripts/fig5.py"


rule fig6:
    input:
        unpack(lambda w: plan.inputs("fig6", w.dataset)),
    output:
        **plan.outputs("fig6", "{dataset}"),
    log:
        plan.log("fig6", "{dataset}"),
    conda:
        "../envs/kinacc.yaml"
    params:
        code=plan.code("fig6"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("fig6", w.dataset),
    message:
        plan.message("fig6")
    script:
        "../scripts/fig6.py"
