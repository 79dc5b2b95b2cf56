# The paper's claims, and whether they hold for other draws of the arm.


rule claims:
    input:
        unpack(lambda w: plan.inputs("claims", w.dataset)),
    output:
        **plan.outputs("claims", "{dataset}"),
    log:
        plan.log("claims", "{dataset}"),
    params:
        code=plan.code("claims"),
        seed=lambda w: plan.seed(w.dataset),
        settings=lambda w: plan.settings("claims", w.dataset),
    message:
        plan.message("claims")
    script:
        "../scripts/claims.py"
