# Pictures, the page of a data set and the digests of all its files.


rule figures:
    """Figs. 1, 2, 4, 5 and 6"""
    input:
        unpack(lambda w: robot(w.dataset)),
        dh_model="results/{dataset}/dh_model.parquet",
        frames="results/{dataset}/frames.parquet",
        measurements="results/{dataset}/measurements.parquet",
        assessment_points="results/{dataset}/assessment_points.parquet",
        study_summary="results/{dataset}/study_summary.parquet",
        histories="results/{dataset}/histories.parquet",
    output:
        **pictures("{dataset}", *FIGURES),
        sums="results/{dataset}/sums/figures.sha256",
    log:
        "results/{dataset}/logs/figures.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("figures.py", "seed robot", shown=True, evaluation="space cylinder tool_mm travel_direction"),
    message:
        "{wildcards.dataset}: drawing Figs. 1, 2, 4, 5 and 6"
    script:
        "../scripts/figures.py"


rule map_figure:
    """Fig. 3, the accuracy maps"""
    input:
        accuracy_map="results/{dataset}/accuracy_map.parquet",
    output:
        **pictures("{dataset}", "fig3"),
        sums="results/{dataset}/sums/map_figure.sha256",
    log:
        "results/{dataset}/logs/map_figure.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("figures.py", shown=True),
    message:
        "{wildcards.dataset}: drawing Fig. 3"
    script:
        "../scripts/figures.py"


rule report:
    """one page that shows what the results are worth"""
    input:
        unpack(lambda w: calibrated(w.dataset) | summed_up(w.dataset) | studied(w.dataset) | campaigns(w.dataset)),
    output:
        html=report("results/{dataset}/report.html", category="{dataset}", labels={"file": "report.html"}),
        sums="results/{dataset}/sums/report.sha256",
    log:
        "results/{dataset}/logs/report.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("report.py", shown=True),
    message:
        "{wildcards.dataset}: writing the page"
    script:
        "../scripts/report.py"


rule digests:
    """digests of all files of a data set, as their stages left them"""
    input:
        lambda w: calibration_of(w.dataset) + study_of(w.dataset),
    output:
        "results/{dataset}/SHA256SUMS",
    log:
        "results/{dataset}/logs/digests.log",
    localrule: True
    conda:
        "../envs/kinacc.yaml"
    shell:
        'cat "$(dirname {output:q})"/sums/*.sha256 > {output:q} 2> {log:q}'
