# From measured poses to calibrated models and what is left of their errors (Tables I to III).


rule measurements:
    """measured poses, read from a file or simulated with the paper's synthetic arm"""
    input:
        unpack(lambda w: robot(w.dataset, measured=True)),
    output:
        measurements="results/{dataset}/measurements.parquet",
        robot="results/{dataset}/robot.parquet",
        sums="results/{dataset}/sums/measurements.sha256",
    log:
        "results/{dataset}/logs/measurements.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job(
            "measurements.py",
            "seed robot measurements",
            measured=True,
            evaluation="reference_orientation_deg reference_frame",
        ),
    message:
        "{wildcards.dataset}: reading or simulating the measured poses"
    script:
        "../scripts/measurements.py"


rule data_check:
    """what is wrong with a measured file; findings that spoil a fit end the run here"""
    input:
        unpack(lambda w: robot(w.dataset, measured=True)),
    output:
        data_check="results/{dataset}/data_check.parquet",
        sums="results/{dataset}/sums/data_check.sha256",
    log:
        "results/{dataset}/logs/data_check.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("data_check.py", "robot measurements calibration data_check", measured=True),
    message:
        "{wildcards.dataset}: checking the measured file"
    script:
        "../scripts/data_check.py"


rule fit_vec:
    """the volumetric error compensation model, eqs. 5 and 6 (Table I)"""
    input:
        unpack(lambda w: robot(w.dataset) | checked(w.dataset)),
        measurements="results/{dataset}/measurements.parquet",
    output:
        vec_model="results/{dataset}/vec_model.parquet",
        vec_frames="results/{dataset}/vec_frames.parquet",
        vec_fit="results/{dataset}/vec_fit.parquet",
        vec_covariance="results/{dataset}/vec_covariance.parquet",
        vec_orders="results/{dataset}/vec_orders.parquet",
        sums="results/{dataset}/sums/fit_vec.sha256",
    log:
        "results/{dataset}/logs/fit_vec.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("fit_model.py", "robot", calibration="rotation_weight_mm_per_rad base_and_tool frames vec"),
        kind="vec",
    message:
        "{wildcards.dataset}: fitting the VEC model to the training poses"
    script:
        "../scripts/fit_model.py"


rule fit_compliance:
    """the DH model with joints that bend under gravity, where calibration.compliance asks for it"""
    input:
        unpack(lambda w: robot(w.dataset) | checked(w.dataset)),
        measurements="results/{dataset}/measurements.parquet",
    output:
        compliance_model="results/{dataset}/compliance_model.parquet",
        compliance_frames="results/{dataset}/compliance_frames.parquet",
        compliance_fit="results/{dataset}/compliance_fit.parquet",
        compliance_covariance="results/{dataset}/compliance_covariance.parquet",
        sums="results/{dataset}/sums/fit_compliance.sha256",
    log:
        "results/{dataset}/logs/fit_compliance.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("fit_model.py", "robot", calibration="rotation_weight_mm_per_rad base_and_tool frames dh compliance"),
        kind="compliance",
    message:
        "{wildcards.dataset}: fitting the DH model with joints that bend"
    script:
        "../scripts/fit_model.py"


rule fit_dh:
    """the DH model, to the VEC model at the measured configurations or to the poses (Table II)"""
    input:
        unpack(lambda w: robot(w.dataset) | further_frames(w.dataset)),
        measurements="results/{dataset}/measurements.parquet",
        vec_model="results/{dataset}/vec_model.parquet",
        vec_frames="results/{dataset}/vec_frames.parquet",
    output:
        dh_model="results/{dataset}/dh_model.parquet",
        frames="results/{dataset}/frames.parquet",
        dh_fit="results/{dataset}/dh_fit.parquet",
        dh_covariance="results/{dataset}/dh_covariance.parquet",
        dh_identified="results/{dataset}/dh_identified.parquet",
        sums="results/{dataset}/sums/fit_dh.sha256",
    log:
        "results/{dataset}/logs/fit_dh.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("fit_model.py", "robot", calibration="rotation_weight_mm_per_rad base_and_tool frames dh"),
        kind="dh",
    message:
        "{wildcards.dataset}: fitting the DH model"
    script:
        "../scripts/fit_model.py"


rule residuals:
    """what is left of the errors, at training and at held-out poses (Tables I and III)"""
    input:
        unpack(lambda w: robot(w.dataset) | models(w.dataset)),
        measurements="results/{dataset}/measurements.parquet",
        vec_orders="results/{dataset}/vec_orders.parquet",
    output:
        residuals="results/{dataset}/residuals.parquet",
        pose_errors="results/{dataset}/pose_errors.parquet",
        model_selection="results/{dataset}/model_selection.parquet",
        joint_bias="results/{dataset}/joint_bias.parquet",
        worst_rows="results/{dataset}/worst_rows.parquet",
        sums="results/{dataset}/sums/residuals.sha256",
    log:
        "results/{dataset}/logs/residuals.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("residuals.py", "robot calibration"),
    message:
        "{wildcards.dataset}: comparing models and measurements, at held-out poses too"
    script:
        "../scripts/residuals.py"


rule excluded_rows:
    """errors of the rows that the configuration excludes, which no fit has seen"""
    input:
        unpack(lambda w: robot(w.dataset, measured=True) | models(w.dataset)),
        measurements="results/{dataset}/measurements.parquet",
    output:
        excluded_rows="results/{dataset}/excluded_rows.parquet",
        sums="results/{dataset}/sums/excluded_rows.sha256",
    log:
        "results/{dataset}/logs/excluded_rows.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("excluded_rows.py", "robot measurements", measured=True),
    message:
        "{wildcards.dataset}: errors of the excluded rows"
    script:
        "../scripts/excluded_rows.py"


rule summary:
    """what the calibration is worth, one figure a row"""
    input:
        unpack(lambda w: robot(w.dataset) | calibrated(w.dataset)),
    output:
        summary="results/{dataset}/summary.parquet",
        sums="results/{dataset}/sums/summary.sha256",
    log:
        "results/{dataset}/logs/summary.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("summary.py", " ".join(CALIBRATION)),
    message:
        "{wildcards.dataset}: summing up what the calibration is worth"
    script:
        "../scripts/summary.py"


rule history:
    """the calibrations of a series held to one another, and their picture"""
    input:
        unpack(lambda w: lines(w.dataset)),
    output:
        **pictures("{dataset}", "history_over_time"),
        history="results/{dataset}/history.parquet",
        sums="results/{dataset}/sums/history.sha256",
    log:
        "results/{dataset}/logs/history.log",
    conda:
        "../envs/kinacc.yaml"
    params:
        **job("history.py", "series calibration", tolerance="mm"),
    message:
        "{wildcards.dataset}: holding the calibrations of the series to one another"
    script:
        "../scripts/history.py"
