# Functions that rules call for their inputs and parameters.
FIGURES = ("fig1", "fig2", "fig4", "fig5", "fig6")  # drawn by kinacc.figures.paper


def job(script, sections="", shown=False, measured=False, **keys):
    """What makes a rule's files anew, by content: settings, files from outside, the seed and the code."""
    # Whole sections of the settings, and single keys by section.
    path = os.path.join(str(workflow.current_basedir), "..", "scripts", script)
    paths = sections.split() + [f"{section}.{key}" for section, own in keys.items() for key in own.split()]
    return {
        "settings": lambda w: data.chosen(w.dataset, *paths),
        "files": lambda w: digests(outside(w.dataset, measured)),
        "seed": lambda w: data.settings[w.dataset]["seed"],
        "code": code_digest(path, shown),
    }


def outside(dataset, measured):
    files = data.robot_files(dataset)
    return files | data.measured_files(dataset) if measured else files


def robot(dataset, measured=False):
    """The robot file of a data set and, where asked for, its measured files."""
    return {role: ancient(path) for role, path in outside(dataset, measured).items()}


def tables(dataset, *names):
    return {name: f"{RESULTS}/{dataset}/{name}.parquet" for name in names}


def models(dataset):
    """Tables of all fitted models of a data set, with their frames."""
    return tables(dataset, *(f"{kind}_model" for kind in data.models(dataset)), "frames")


def further_frames(dataset):
    """Frames of the models fitted before the DH model that it does not name itself."""
    return tables(dataset, *(f"{kind}_frames" for kind in data.models(dataset) if kind not in ("vec", "dh")))


def checked(dataset):
    """The check of a measured file; a fit waits for it."""
    return tables(dataset, "data_check") if data.is_measured(dataset) else {}


def mapped(dataset):
    return tables(dataset, "accuracy_map") if data.has_map(dataset) else {}


def further_arms(dataset):
    """Claims on further synthetic arms, where they were made or `robustness` is asked for."""
    path = tables(dataset, "robustness")
    asked = "robustness" in workflow.dag_settings.targets
    return path if not data.is_measured(dataset) and (asked or os.path.exists(path["robustness"])) else {}


def calibrated(dataset):
    """Tables of the calibration of a data set, from the measurements on."""
    found = tables(dataset, "measurements", "robot", "residuals", "pose_errors", "model_selection", "worst_rows")
    found |= models(dataset) | tables(dataset, "dh_identified", "vec_orders") | checked(dataset)
    found |= tables(dataset, *(f"{kind}_{of}" for kind in data.models(dataset) for of in ("fit", "covariance")))
    has_excluded = data.settings[dataset]["measurements"].get("file", {}).get("exclude")
    return found | (tables(dataset, "excluded_rows") if has_excluded else {})


def studied(dataset):
    """Tables of the study of a data set."""
    found = tables(dataset, "assessment_points", "study", "study_summary", "readings", "histories")
    return found | mapped(dataset) | ({} if data.is_measured(dataset) else tables(dataset, "claims"))


def campaigns(dataset):
    found = campaign_files(campaigns_of(Path(RESULTS, dataset)))
    return {role: os.path.abspath(path) if data.absolute else path for role, path in found.items()}


def lines(dataset):
    """Tables of the calibration of every line of a series, by <line>/<table>, and campaigns."""
    names = ("measurements", "robot", "pose_errors", "model_selection")
    found = {f"{dataset}/{role}": path for role, path in campaigns(dataset).items()}
    for line in data.lines(dataset):
        own = tables(line, *names) | models(line) | campaigns(line)
        found |= {f"{line}/{name}": path for name, path in own.items()}
    return found


def summed_up(dataset):
    """Tables made of the calibration: its summary and the history of a series."""
    return tables(dataset, "summary", *(["history"] if data.lines(dataset) else []))


def pictures(dataset, *names):
    return {f"{name}_{kind}": f"{RESULTS}/{dataset}/figures/{name}.{kind}" for name in names for kind in data.formats}


def calibration_of(dataset):
    """Every file of the calibration of a data set."""
    drawn = pictures(dataset, "history_over_time") if data.lines(dataset) else {}
    return [*(calibrated(dataset) | summed_up(dataset) | drawn).values()]


def study_of(dataset):
    """Every file of the study of a data set, and its page."""
    drawn = pictures(dataset, *FIGURES, *(["fig3"] if mapped(dataset) else []))
    return [*(studied(dataset) | drawn).values(), f"{RESULTS}/{dataset}/report.html"]
