# Pictures, the page of a data set and the digests of all its files.


rule figures:
    """Figs. 1, 2, 4, 5 and 6"""
    input:
        unpack(lambda w: from_outside(w.dataset)),
        dh_model="results/{dataset}/dh_model.parquet",
        frames="results/{dataset}/frames.parquet",
        assessment_points="results/{dataset}/assessment_points.parquet",
        study_summary="results/{dataset}/study_summary.parquet",
        histories="results/{dataset}/histories.parquet",
    output:
        **{
            f"fig{n}_{kind}": f"results/{{dataset}}/figures/fig{n}.{kind}"
            for n in (1, 2, 4, 5, 6)
            for kind in data.formats
        },
        sums="results/{dataset}/sums/figures.sha256",
    log:
        "results/{dataset}/logs/figures.log",
    group:
        "data_set"
    conda:
        "../envs/kinacc.yaml"
    params:
        settings=values(
            "seed",
            "robot",
            "evaluation.space",
            "evaluation.cylinder",
            "evaluation.tool_mm",
            "measurements.source",
        ),
        files=content(),
        seed=seed,
        code=code("figures.py", shown=True),
    message:
        "{wildcards.dataset}: drawing Figs. 1, 2, 4, 5 and 6"
    script:
        "../scripts/figures.py"


rule map_figure:
    """Fig. 3, the accuracy maps"""
    input:
        accuracy_map="results/{dataset}/accuracy_map.parquet",
    output:
        **{f"fig3_{kind}": f"results/{{dataset}}/figures/fig3.{kind}" for kind in data.formats},
        sums="results/{dataset}/sums/map_figure.sha256",
    log:
        "results/{dataset}/logs/map_figure.log",
    group:
        "data_set"
    conda:
        "../envs/kinacc.yaml"
    params:
        settings=values(),
        seed=seed,
        code=code("map_figure.py", shown=True),
    message:
        "{wildcards.dataset}: drawing Fig. 3"
    script:
        "../scripts/map_figure.py"


rule report:
    """one page that shows what the results are worth"""
    input:
        unpack(lambda w: page_inputs(w.dataset)),
    output:
        html=report(
            "results/{dataset}/report.html", category="{dataset}", labels={"file": "report.html"}
        ),
        sums="results/{dataset}/sums/report.sha256",
    log:
        "results/{dataset}/logs/report.log",
    group:
        "data_set"
    conda:
        "../envs/kinacc.yaml"
    params:
        settings=values(),
        seed=seed,
        code=code("report.py", shown=True),
    message:
        "{wildcards.dataset}: writing the page"
    script:
        "../scripts/report.py"


rule digests:
    """digests of all files of a data set, as their stages left them"""
    input:
        lambda w: sums_of(w.dataset),
    output:
        "results/{dataset}/SHA256SUMS",
    log:
        "results/{dataset}/logs/digests.log",
    localrule: True
    conda:
        "../envs/kinacc.yaml"
    message:
        "{wildcards.dataset}: gathering digests"
    shell:
        "cat {input:q} > {output:q} 2> {log:q}"
