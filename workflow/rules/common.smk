# Functions that rules call for their inputs and parameters.
CODE = {}


def code(script, shown=False):
    """Digest of a rule's script and of the package, so that a change of either makes tables anew."""
    path = os.path.join(str(workflow.current_basedir), "..", "scripts", script)
    return CODE.setdefault((script, shown), code_digest(path, shown))


def values(*paths):
    """Settings of the data set of a job; only a change of these makes its files anew."""
    return lambda wildcards: data.chosen(wildcards.dataset, *paths)


def seed(wildcards):
    return data.settings[wildcards.dataset]["seed"]


def content(*kinds):
    """Digests of the files from outside that a job reads: their dates do not count."""
    return lambda wildcards: digests(outside(wildcards.dataset, *kinds))


def outside(dataset, *kinds):
    found = data.robot_files(dataset)
    return found | data.measured_files(dataset) if "measured" in kinds else found


def from_outside(dataset, *kinds):
    return {role: ancient(path) for role, path in outside(dataset, *kinds).items()}


def table(dataset, name):
    return f"{RESULTS}/{dataset}/{name}.parquet"


def tables(dataset, *names):
    return {name: table(dataset, name) for name in names}


def models(dataset):
    """Tables of all fitted models of a data set, with their frames."""
    return tables(dataset, *(f"{kind}_model" for kind in data.models(dataset)), "frames")


def fit_tables(dataset):
    kinds = data.models(dataset)
    found = [f"{kind}_{what}" for kind in kinds for what in ("fit", "covariance")]
    return tables(dataset, *found, "dh_identified", "vec_orders")


def checked(dataset):
    """The check of a measured file; a fit waits for it."""
    return tables(dataset, "data_check") if data.is_measured(dataset) else {}


def excluded(dataset):
    file = data.settings[dataset]["measurements"].get("file", {})
    return tables(dataset, "excluded_rows") if "exclude" in file else {}


def mapped(dataset):
    return tables(dataset, "accuracy_map") if data.has_map(dataset) else {}


def further_arms(dataset):
    """Claims on further synthetic arms, where they were made or `robustness` is asked for."""
    path = table(dataset, "robustness")
    asked = "robustness" in workflow.dag_settings.targets
    made = not data.is_measured(dataset) and (asked or os.path.exists(path))
    return {"robustness": path} if made else {}


def campaign_inputs(dataset):
    found = campaign_files(campaigns_of(Path(RESULTS, dataset)))
    return {role: os.path.abspath(path) if data.absolute else path for role, path in found.items()}


def calibration_of(dataset):
    """Every file of the calibration of a data set."""
    found = tables(dataset, "measurements", "robot", "residuals", "summary")
    found |= models(dataset) | fit_tables(dataset) | checked(dataset) | excluded(dataset)
    if data.lines(dataset):
        found |= tables(dataset, "history")
        found |= {kind: path for kind, path in pictures(dataset, "history_over_time")}
    return list(found.values())


def pictures(dataset, *names):
    return [
        (f"{name}_{kind}", f"{RESULTS}/{dataset}/figures/{name}.{kind}")
        for name in names
        for kind in data.formats
    ]


def study_of(dataset):
    """Every file of the study of a data set beside its calibration."""
    if dataset not in data.told:
        return []
    found = tables(dataset, "assessment_points", "study", "study_summary", "readings", "histories")
    found |= mapped(dataset)
    found |= {} if data.is_measured(dataset) else tables(dataset, "claims")
    drawn = ["fig1", "fig2", "fig4", "fig5", "fig6", *(["fig3"] if mapped(dataset) else [])]
    found |= dict(pictures(dataset, *drawn))
    page = f"{RESULTS}/{dataset}/report.html"
    return [*found.values(), page, f"{RESULTS}/{dataset}/SHA256SUMS"]


def further_frames(dataset):
    further = [kind for kind in data.models(dataset) if kind not in ("vec", "dh")]
    return tables(dataset, *(f"{kind}_frames" for kind in further))


def lines_of(dataset):
    """Tables of the calibration of every line of a series, by <line>/<table>, and campaigns."""
    names = ("measurements", "robot", "pose_errors", "model_selection")
    found = {
        f"{line}/{name}": path
        for line in data.lines(dataset)
        for name, path in (tables(line, *names) | models(line)).items()
    }
    for each in [dataset, *data.lines(dataset)]:
        found |= {f"{each}/{role}": path for role, path in campaign_inputs(each).items()}
    return found


def page_inputs(dataset):
    """What the page of a data set shows: all tables that it has, and campaigns on it."""
    names = ("measurements", "robot", "pose_errors", "model_selection", "residuals", "worst_rows")
    found = tables(dataset, *names, "summary")
    found |= models(dataset) | fit_tables(dataset) | checked(dataset) | excluded(dataset)
    found |= tables(dataset, "assessment_points", "study", "study_summary", "readings", "histories")
    found |= mapped(dataset)
    found |= {} if data.is_measured(dataset) else tables(dataset, "claims")
    found |= tables(dataset, "history") if data.lines(dataset) else {}
    return found | campaign_inputs(dataset)


def sums_of(dataset):
    """Digests that the rules of a plain run leave for a data set."""
    rules_of = ["measurements", "fit_vec", "fit_dh", "residuals", "summary", "operating_points"]
    rules_of += ["study", "histories", "figures", "report"]
    rules_of += [f"fit_{kind}" for kind in data.models(dataset) if kind not in ("vec", "dh")]
    rules_of += ["data_check"] if data.is_measured(dataset) else ["claims"]
    rules_of += ["excluded_rows"] if excluded(dataset) else []
    rules_of += ["accuracy_map", "map_figure"] if data.has_map(dataset) else []
    rules_of += ["history"] if data.lines(dataset) else []
    rules_of += [f"study_part.{n}-of-{data.parts}" for n in range(1, data.parts + 1)]
    return [f"{RESULTS}/{dataset}/sums/{name}.sha256" for name in rules_of]
