# From the models to the assessed accuracy: map (Fig. 3), operating points, study (Fig. 4), histories, claims.


rule accuracy_map:
    """the largest error over the slices of the evaluation space (Fig. 3)"""
    input:
        unpack(lambda w: robot(w.dataset) | models(w.dataset)),
    output:
        accuracy_map="results/{dataset}/accuracy_map.parquet",
        sums="results/{dataset}/sums/accuracy_map.sha256",
    log:
        "results/{dataset}/logs/accuracy_map.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job(
            "accuracy_map.py",
            "robot map",
            evaluation="cylinder reference_orientation_deg reference_frame rotation_deg rotations tool_mm invert_with travel_direction",
        ),
    message:
        "{wildcards.dataset}: mapping the largest error (Fig. 3)"
    script:
        "../scripts/accuracy_map.py"


rule operating_points:
    """the operating points of the study and their true errors"""
    input:
        unpack(lambda w: robot(w.dataset) | models(w.dataset)),
        measurements="results/{dataset}/measurements.parquet",
        pose_errors="results/{dataset}/pose_errors.parquet",
    output:
        assessment_points="results/{dataset}/assessment_points.parquet",
        sums="results/{dataset}/sums/operating_points.sha256",
    log:
        "results/{dataset}/logs/operating_points.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("operating_points.py", "robot evaluation"),
    message:
        "{wildcards.dataset}: choosing the operating points of the study"
    script:
        "../scripts/operating_points.py"


rule study_part:
    """the assessors under noise, a part of the repetitions"""
    input:
        assessment_points="results/{dataset}/assessment_points.parquet",
    output:
        study_chunk="results/{dataset}/study_chunk/{scatteritem}.parquet",
        sums="results/{dataset}/sums/study_part.{scatteritem}.sha256",
    log:
        "results/{dataset}/logs/study_part.{scatteritem}.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("study_part.py", "seed", study="noise_mm repetitions measurements alpha visiting_order"),
    message:
        "{wildcards.dataset}: simulating the assessors under noise, part {wildcards.scatteritem}"
    script:
        "../scripts/study_part.py"


rule study:
    """the parts of the study together, summed up (Fig. 4)"""
    input:
        study_chunk=gather.study("results/{{dataset}}/study_chunk/{scatteritem}.parquet"),
        assessment_points="results/{dataset}/assessment_points.parquet",
    output:
        study="results/{dataset}/study.parquet",
        study_summary="results/{dataset}/study_summary.parquet",
        readings="results/{dataset}/readings.parquet",
        sums="results/{dataset}/sums/study.sha256",
    log:
        "results/{dataset}/logs/study.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("study.py", "seed study"),
    message:
        "{wildcards.dataset}: summing up the study (Fig. 4)"
    script:
        "../scripts/study.py"


rule histories:
    """single model invalidations step by step (Figs. 5 and 6)"""
    input:
        assessment_points="results/{dataset}/assessment_points.parquet",
    output:
        histories="results/{dataset}/histories.parquet",
        sums="results/{dataset}/sums/histories.sha256",
    log:
        "results/{dataset}/logs/histories.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("histories.py", "seed histories", study="measurements alpha distance covariance search visiting_order"),
    message:
        "{wildcards.dataset}: following single model invalidations (Figs. 5 and 6)"
    script:
        "../scripts/histories.py"


rule claims:
    """the paper's numbers and sentences held to the results"""
    input:
        unpack(lambda w: mapped(w.dataset) | further_arms(w.dataset)),
        residuals="results/{dataset}/residuals.parquet",
        dh_model="results/{dataset}/dh_model.parquet",
        assessment_points="results/{dataset}/assessment_points.parquet",
        study="results/{dataset}/study.parquet",
        study_summary="results/{dataset}/study_summary.parquet",
        readings="results/{dataset}/readings.parquet",
        histories="results/{dataset}/histories.parquet",
    output:
        claims="results/{dataset}/claims.parquet",
        sums="results/{dataset}/sums/claims.sha256",
    log:
        "results/{dataset}/logs/claims.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("claims.py", "robot measurements calibration evaluation map study histories"),
    message:
        "{wildcards.dataset}: holding the paper's claims to the results"
    script:
        "../scripts/claims.py"


rule robustness_part:
    """fits, study and claims with further draws of the synthetic arm, a part of them; on request"""
    input:
        unpack(lambda w: robot(w.dataset)),
    output:
        robustness_chunk="results/{dataset}/robustness_chunk/{scatteritem}.parquet",
        sums="results/{dataset}/sums/robustness_part.{scatteritem}.sha256",
    log:
        "results/{dataset}/logs/robustness_part.{scatteritem}.log",
    conda:
        "../envs/kinacc.yaml"
    resources:
        runtime=lambda w, attempt: 60 * attempt,
    params:
        **job("robustness_part.py", "seed robot measurements calibration evaluation map study histories robustness"),
    message:
        "{wildcards.dataset}: the study on further synthetic arms, part {wildcards.scatteritem}"
    script:
        "../scripts/robustness_part.py"


rule robustness_table:
    """the claims on further draws of the synthetic arm; on request"""
    input:
        robustness_chunk=gather.study("results/{{dataset}}/robustness_chunk/{scatteritem}.parquet"),
    output:
        robustness="results/{dataset}/robustness.parquet",
        sums="results/{dataset}/sums/robustness_table.sha256",
    log:
        "results/{dataset}/logs/robustness_table.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("robustness_table.py"),
    message:
        "{wildcards.dataset}: gathering the claims on further synthetic arms"
    script:
        "../scripts/robustness_table.py"
