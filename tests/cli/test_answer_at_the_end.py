"""What a run ends with, as an engineer reads it: half a page, and the same facts in a table."""

import html
import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from command_line import call, small_study
from stages_by_hand import run_stage

from kinacc.calibration.summary_words import half_page
from kinacc.kinematics import robot
from kinacc.report import answer
from kinacc.tables import store


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Results of a small synthetic study, up to its summary."""
    base = tmp_path_factory.mktemp("study")
    folder = small_study(base)
    config, results = base / "small.yaml", folder.parent
    done = run_stage("summary", "--config", config, "--results", results)
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture
def folder(study, tmp_path, monkeypatch):
    """A copy of the results, in a folder that is the current one."""
    shutil.copytree(study, tmp_path / "results" / "mh180")
    monkeypatch.chdir(tmp_path)
    return "results/mh180"


def calibrated(base, accept=""):
    """Results of ``own.csv`` in a folder; ``accept``: findings of its check, with reasons."""
    (base / "own.yaml").write_text(
        "measurements: {folds: 4}\ndatasets:\n  own:\n"
        "    calibration: {base_and_tool: estimated, vec: {order: 1}, dh: {fit_to: measurements}}\n"
        "    robot: irb120\n    evaluation: {space: measured}\n"
        f"    data_check: {{accept: {{{accept}}}}}\n"
        "    measurements: {source: file, file: {path: own.csv, orientation: {kind: none}}}\n"
    )
    for stage in ("measurements", "data_check", "vec", "dh", "residuals", "summary"):
        words = ("--config", base / "own.yaml", "--results", base / "results")
        done = run_stage(stage, *words)
        assert done.exit_code == 0, done.output
    return base / "results" / "own"


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Results of a measured arm with one joint that hardly moves, and a file with an outlier."""
    base = tmp_path_factory.mktemp("own")
    arm = robot.load("irb120")
    draw = np.random.default_rng(0)
    q = draw.uniform(-1.0, 1.0, (60, 6))
    q[:, 0] *= 0.05
    place = robot.forward(arm, q).position_mm + draw.normal(0.0, 0.05, (60, 3))
    place[17, 0] += 6.0
    lines = [",".join([*(f"q{i}_rad" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"])]
    lines += [",".join(f"{value:.9f}" for value in row) for row in np.hstack([q, place])]
    (base / "own.csv").write_text("\n".join(lines) + "\n")
    return calibrated(base, accept="outliers: left in on purpose, few_poses: a test")


@pytest.fixture(scope="module")
def reflectors(tmp_path_factory):
    """Results of an arm that carries three reflectors."""
    base = tmp_path_factory.mktemp("reflectors")
    arm = robot.load("irb120")
    draw = np.random.default_rng(0)
    q = draw.uniform(-1.0, 1.0, (60, 6))
    flange = robot.forward(arm, q)
    places = [flange.position_mm + flange.rotation @ (40.0 * np.eye(3)[axis]) for axis in range(3)]
    names = [f"q{i}_rad" for i in range(1, 7)]
    names += [f"m{name}_{axis}_mm" for name in "ABC" for axis in "xyz"]
    rows = np.hstack([q, *places]) + np.hstack([np.zeros((60, 6)), draw.normal(0, 0.05, (60, 9))])
    np.savetxt(base / "own.csv", rows, "%.9f", ",", header=",".join(names), comments="")
    return calibrated(base)


def shown(*words):
    done = call("fitted", *words)
    assert done.exit_code == 0, done.output
    return done.output


def figures_of(page, model):
    """Mean, 99 % and largest of a model's line."""
    (line,) = re.findall(rf"^    {model}\b.*$", page, re.M)
    return [float(each) for each in re.findall(r"\d+\.\d{3}", line)]


def test_errors_before_and_after_are_of_the_same_held_out_rows(folder):
    page = shown(folder)
    table = store.read(f"{folder}/pose_errors.parquet")
    rows = {}
    for model in ("nominal", "DH", "VEC"):
        own = table["comparison"] == f"{model.lower()}_vs_measured"
        own &= table["estimate"] == "cross_validated"
        rows[model] = table["row"][own]
        size = np.linalg.norm([table[f"e{axis}_mm"][own] for axis in "xyz"], axis=0)
        wanted = size.mean(), np.quantile(size, 0.99), size.max()
        assert figures_of(page, model) == pytest.approx(wanted, abs=6e-4)
    assert np.array_equal(rows["nominal"], rows["DH"])
    assert f"{len(rows['DH'])} rows" in page
    assert page.count("<- selected") == 1
    assert "held-out error" in page
    assert "training error" not in page


def test_every_pose_of_an_own_file_fits_the_delivered_models(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arm, draw = robot.load("irb120"), np.random.default_rng(0)
    q = draw.uniform(-1.0, 1.0, (66, 6))
    place = robot.forward(arm, q).position_mm + draw.normal(0.0, 0.05, (66, 3))
    lines = [",".join([*(f"q{i}_rad" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"])]
    lines += [",".join(f"{value:.9f}" for value in row) for row in np.hstack([q, place])]
    Path("own.csv").write_text("\n".join(lines) + "\n")
    assert call("init", "own.csv", "--robot", "irb120", "--yes").exit_code == 0
    for stage in ("measurements", "data_check", "vec", "dh", "residuals", "summary"):
        done = run_stage(stage, "--config", "own.yaml", "--results", "results")
        assert done.exit_code == 0, done.output
    page = shown("results/own")
    assert "kept out" not in page
    assert "66 readings of 1 target at 66 poses" in page
    assert "held-out error, mm (poses left out of the fit; 66 rows)" in page
    table = store.read("results/own/residuals.parquet")
    pooled = np.isnan(table["fold"]) & (table["comparison"] == "dh_vs_measured")
    assert dict(zip(table["subset"][pooled], table["n"][pooled], strict=True)) == {
        "train": 66,
        "validation": 66,
    }


def test_nominal_says_whether_base_and_tool_were_fitted(folder, measured):
    assert "nominal, with base and tool fitted" in shown(measured)
    assert "base and tool" not in shown(folder)


def test_the_page_is_half_a_page(folder, measured, monkeypatch):
    # The second is of poor data: what is wrong with them takes some lines more, and one says how to
    # find the noise of an arm that can be measured.
    for each, most in ((folder, 26), (measured, 30)):
        there = Path(each).absolute()
        monkeypatch.chdir(there.parents[1])  # a long path takes lines of its own
        lines = shown(there.relative_to(there.parents[1])).splitlines()
        assert len(lines) <= most, "\n".join(lines)
        prose = [line for line in lines if "kinacc " not in line]
        assert max(map(len, prose)) <= 100, max(prose, key=len)


def test_why_the_model_is_selected_is_one_sentence(folder):
    choice = store.read(f"{folder}/model_selection.parquet")
    vec = list(choice["model"]).index("vec")
    text = " ".join(shown(folder).split())
    gain, error = abs(choice["gain_mm2"][vec]), choice["gain_std_error_mm2"][vec]
    assert f"by {gain:.3f} +- {error:.3f} mm^2" in text
    name = "VEC" if choice["selected"][vec] else "DH"
    assert f"{name} is selected: " in text
    assert "two standard errors" in text or "higher by" in text


def test_a_calibration_that_is_worse_than_none_says_so(folder, measured):
    assert figures_of(shown(measured), "nominal")[0] < figures_of(shown(measured), "DH")[0]
    assert "no nearer" not in shown(folder)


def test_the_table_holds_the_facts_of_the_page(folder):
    table = pq.read_table(f"{folder}/summary.parquet").to_pylist()
    value = {(row["topic"], row["item"], row["statistic"]): row["value"] for row in table}
    page = shown(folder)
    for model in ("nominal", "DH", "VEC"):
        wanted = [
            value["held_out_error", model.lower(), name]
            for name in ("mean", "quantile_99", "largest")
        ]
        assert figures_of(page, model) == pytest.approx(wanted, abs=6e-4)
    answer = json.loads(shown(folder, "--json"))
    assert answer["held_out_error"]["dh"]["largest"] == value["held_out_error", "dh", "largest"]
    units = {row["unit"] for row in table if row["topic"] == "held_out_error"}
    assert units == {"1", "mm"}


def test_what_is_wrong_with_the_data_stands_beside_them(measured):
    page = shown(measured)
    assert "60 readings of 1 target at 60 poses: irb120, a measured arm" in page
    assert "line 19" in page
    assert "nothing suspicious" not in page


def test_a_joint_that_hardly_moves_is_no_suspicion_here_as_in_check_data(measured):
    config = measured.parent.parent / "own.yaml"
    told = json.loads(call("check-data", config, "--json").stdout)["datasets"][0]["remarks"]
    (note,) = (each for each in told if each.startswith("joint 1 moves through"))
    assert f"note: {note}" in " ".join(shown(measured).split())
    tables = answer.read(measured)
    kept = tables["data_check"]["finding"] == "thin_coverage"
    alone = {name: values[kept] for name, values in tables["data_check"].items()}
    page = half_page(answer.facts_of({**tables, "data_check": alone}), "kinacc fitted own --all")
    (head,) = (line for line in page if line.startswith("check"))
    assert head.split(maxsplit=1)[1] == "nothing suspicious"
    assert f"note: {note}" in " ".join(" ".join(page).split())


def test_where_the_calibration_is_valid_is_said_joint_by_joint(measured):
    rows = pq.read_table(measured / "summary.parquet").to_pylist()
    share = {
        row["item"]: row["value"]
        for row in rows
        if row["topic"] == "range" and row["statistic"] == "share"
    }
    arm = robot.load("irb120")
    q = store.read(measured / "measurements.parquet")
    for joint in range(6):
        travel = arm.q_max_rad[joint] - arm.q_min_rad[joint]
        wanted = np.ptp(q[f"q{joint + 1}"]) / travel
        assert share[f"joint {joint + 1}"] == pytest.approx(wanted)
        assert f"({wanted:.0%})" in shown(measured)
    assert share["joint 1"] < 0.03


def test_what_is_left_open_is_short_and_the_rest_one_command_away(measured):
    said = json.loads(shown(measured, "--json"))["undetermined"]
    page, whole = (" ".join(shown(*words).split()) for words in ((measured,), (measured, "--all")))
    told = [each for each in said if each in page]
    assert 1 <= len(told) <= 3 < len(said)
    assert told == said[: len(told)]
    assert f"and {len(said) - len(told)} more: kinacc fitted {measured} --all" in page
    assert all(each in whole for each in said)
    assert "training error" in whole


def test_without_a_campaign_the_largest_error_is_not_assessed(folder):
    page = shown(folder)
    assert "not assessed" in page
    (command,) = re.findall(r"kinacc (campaign start .* --noise-mm NOISE .*)$", page, re.M)
    done = call(*command.replace("NOISE", "0.05").split())
    assert done.exit_code == 0, done.output


def test_what_repeats_tell_of_the_noise_stands_beside_the_question_for_it(folder, measured):
    page = " ".join(shown(measured).split())
    asked, told, command = (
        page.index(each) for each in ("(NOISE:", "of ten visits to a pose", "--noise-mm NOISE")
    )
    assert asked < told < command
    assert "ten visits" not in shown(folder)  # nobody can go to a pose of a synthetic arm


def test_every_command_of_the_page_runs_as_printed_once_the_noise_is_filled_in(
    folder, measured, tmp_path
):
    shutil.copytree(measured, tmp_path / "my results" / "own")
    for each in (folder, "my results/own"):
        page = shown(each).replace("NOISE", "0.05")
        lines = re.findall(r"(?:^.{17}|: )kinacc (.*)$", page, re.M)
        assert {line.split()[0] for line in lines} >= {"campaign", "export", "compensate"}
        for line in lines:
            assert "--help" not in line
            done = call(*shlex.split(line))
            assert done.exit_code == 0, f"{line}: {done.output}"
    assert {path.name for path in tmp_path.iterdir()} >= {"exported", "exported_own", "check"}


def campaign(folder, place, readings, noise=0.05):
    """A campaign of five candidates beside the results, so many of its readings taken."""
    words = ("--model", "dh", "--drawn", 5, "--budget", 8, "--noise-mm", noise)
    begun = call("campaign", "start", place, "--calibration", folder, *words)
    assert begun.exit_code == 0, begun.output
    for number in range(readings):
        row = json.loads(call("campaign", "next", place, "--json").stdout)["rows"][0]
        at = ",".join(str(row[f"expected_{axis}_mm"] + 0.01 * number) for axis in "xyz")
        assert call("campaign", "record", place, f"--position-mm={at}").exit_code == 0


def test_the_bound_of_a_campaign_beside_the_results_is_told(folder):
    campaign(folder, "my check", 8)
    page = " ".join(shown(folder).split())
    status = call("campaign", "status", "my check", "--simulations", 0).output
    (statement,) = (line for line in status.splitlines() if "all 5 candidates" in line)
    assert statement in page
    for words in ("DH model, 5 candidates", "0.05 mm per axis", "8 of 8 readings", "95%"):
        assert words in page, words
    assert "not assessed" not in page
    assert "kinacc campaign report 'my check'" in page
    bound = json.loads(shown(folder, "--json"))["largest_error"]
    assert bound["campaign"] == "my check"
    assert f"{bound['upper_mm']:.3f} mm" in statement


def test_a_campaign_of_an_earlier_calibration_bounds_nothing_now(folder):
    campaign(folder, "old", 8)
    path = f"{folder}/dh_model.parquet"
    table = store.read(path)
    table["a_mm"] = table["a_mm"] + 0.01
    store.write(path, "dh_model", table, store.read_metadata(path))
    page = " ".join(shown(folder).split())
    assert "campaign old was begun with another calibration of mh180" in page
    assert "not assessed" in page
    assert json.loads(shown(folder, "--json"))["largest_error"] is None


def test_a_campaign_that_cannot_be_read_does_not_hide_the_answer(folder):
    campaign(folder, "check", 2)
    with open("check/readings.jsonl", "r+") as journal:
        text = journal.read().replace("position_mm", "position_nm", 1)
        journal.seek(0)
        journal.write(text)
    page = shown(folder)
    assert "not assessed" in page
    assert "kinacc campaign start check_mh180 " in page  # that one is in the way


def test_of_several_reflectors_it_is_said_which_a_campaign_is_about_and_how_to_take_another(
    reflectors, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    told = "a campaign is about one point: mA, the first of mA, mB, mC; --point names another"
    assert told in " ".join(shown(reflectors).split())
    words = ("--calibration", reflectors, "--noise-mm", 0.05, "--drawn", 5, "--budget", 8)
    first = call("campaign", "start", "first", *words)
    assert told in first.output
    other = call("campaign", "start", "other", *words, "--point", "mB")
    assert "one point: mB, of mA, mB, mC; --point" in other.output


def test_with_one_target_no_choice_between_points_is_offered(measured, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "--point" not in shown(measured)


def test_every_99_percent_figure_says_whether_it_was_counted_or_fitted(folder):
    assert re.findall(r"99\W{1,2}(\w+)", shown(folder)) == ["empirical"]
    done = call("export", folder, "--format", "markdown", "--format", "latex", "--out", "tables")
    assert done.exit_code == 0, done.output
    for page in Path("tables").iterdir():
        assert set(re.findall(r"99[ ~\\,]*%[ ~]*(\w*)", page.read_text())) == {"gamma"}


def test_errors_at_poses_no_fit_had_seen_have_one_name_in_all_answers(folder, measured):
    said = [shown(folder), shown(measured, "--all"), call("plan-campaign", "--help").output]
    done = call("predict", folder, f"{folder}/measurements.parquet", "--json")
    said += [done.output, call("export", folder, "--out", "files").output]
    for text in said:
        assert "cross-valid" not in text
        assert "kept out" not in text
        assert "validation poses" not in text


def test_the_export_that_the_page_names_writes_the_model_that_was_selected(folder):
    path = f"{folder}/model_selection.parquet"
    choice = store.read(path)
    choice["selected"] = (choice["model"] == "vec").astype(int)
    store.write(path, "model_selection", choice, store.read_metadata(path))
    (command,) = re.findall(r"kinacc (export .*)$", shown(folder), re.M)
    done = call(*shlex.split(command))
    assert done.exit_code == 0, done.output
    assert "without --model writes the plainest one: DH" in done.output
    (written,) = Path("exported").iterdir()
    assert json.loads(written.read_text())["error_model"] == "vec"
    # The files that controllers read go beside it, and say where the selected model is.
    done = call("export", folder, "--out", "exported")
    assert done.exit_code == 0, done.output
    assert "--model vec writes the selected one, as JSON" in done.output
    page = Path("exported/mh180_tables.md").read_text()
    assert page.startswith("**VEC model (selected) against measurements")


def test_where_orientations_were_measured_their_held_out_errors_are_told(folder, measured):
    table = store.read(f"{folder}/pose_errors.parquet")
    best = next(m for m in ("DH", "VEC") if re.search(rf" {m}.*<- selected", shown(folder)))
    for model in ("nominal", "DH", "VEC"):
        own = table["comparison"] == f"{model.lower()}_vs_measured"
        own &= table["estimate"] == "cross_validated"
        size = np.linalg.norm([table[f"r{axis}_mrad"][own] for axis in "xyz"], axis=0)
        wanted = [size.mean(), np.quantile(size, 0.99), size.max()]
        told = json.loads(shown(folder, "--json"))["held_out_orientation_error"][model.lower()]
        assert [told[each] for each in ("mean", "quantile_99", "largest")] == pytest.approx(wanted)
        line = re.findall(rf"^    orientation, {model}, in mrad.*$", shown(folder, "--all"), re.M)
        numbers = [float(each) for each in re.findall(r"\d+\.\d{3}", line[0])]
        assert numbers == pytest.approx(wanted, abs=6e-4)
        assert (line[0] in shown(folder)) == (model == best)
    assert "orientation" not in shown(measured, "--all")
    assert "positions only" in shown(measured)
    assert "positions only" not in shown(folder)


def test_what_further_poses_would_settle_is_told_before_what_none_can():
    from kinacc.calibration.blind_words import WEAK
    from kinacc.calibration.summary import Fact
    from kinacc.calibration.summary_words import _undetermined

    texts = ["d of joint 1 is a convention", "a of joint 5 is one", f"y is like z {WEAK}"]
    facts = [Fact("undetermined", "parameters", "statement", text=text) for text in texts]
    assert _undetermined(facts, None, "more")[0] == texts[2]


@pytest.mark.parametrize(
    ("tried", "folds", "told"),
    [
        # Of three reflectors at 60 poses 45 are left without a fold: they carry order 9, and 10 is
        # the next that would be tried after 8.
        ((1, 2, 8), (8, 8), "VEC, order 8, the highest 60 configurations carry"),
        ((1, 2, 6), (6, 6), "VEC, order 6, the highest allowed (vec.order_highest)"),
        ((1, 2, 8), (2, 8), "VEC, order 8 (held out: 2 to 8), all the data carry"),
        ((1, 2, 6), (1, 6), "VEC, order 6 (held out: 1 to 6), the most allowed"),
        ((1, 2, 8), (2, 2), "VEC, order 2 "),
    ],
)
def test_a_model_of_the_highest_order_says_whether_settings_or_poses_set_it(
    tried, folds, told, reflectors
):
    from kinacc.calibration.summary_words import half_page
    from kinacc.report.answer import facts_of, read

    tables = read(reflectors)
    own = max(folds)
    orders = [(number, order, order == at) for number, at in enumerate(folds) for order in tried]
    fold, order, chosen = np.array(orders, dtype=float).T
    tables |= {"vec_orders": {"fold": fold, "order": order, "chosen": chosen}}
    tables |= {"vec_model": {"order": np.array([own])}}
    lines = half_page(facts_of(tables), "kinacc fitted own --all")
    (line,) = (each for each in lines if each.startswith("    VEC"))
    (plain,) = (each for each in lines if each.startswith("    DH"))
    assert line.strip().startswith(told)
    assert line.count(".") == plain.count(".") + told.count(".")
    assert line.rindex(".") == plain.rindex(".")  # figures stand under each other
    assert len(line) <= 100


def test_a_stated_base_and_tool_leave_all_readings_to_the_model(reflectors):
    from kinacc.report.answer import facts_of, read

    tables = read(reflectors)
    pose, frames = tables["measurements"]["pose"], tables["frames"]
    number = np.unique(pose, return_inverse=True)[1]
    tables["measurements"] |= {"fold": np.where(number < 38, number % 4, np.nan)}
    # 28 poses are left without a fold, 252 numbers: as many as a model of order 6 has, which base
    # and targets would take 15 of.
    tried, fold = np.array([1.0, 2.0, 5.0]), np.zeros(3)
    tables |= {"vec_orders": {"fold": fold, "order": tried, "chosen": tried == 5}}
    limits = []
    for stated in (False, True):
        if stated:
            own = {name: values[frames["model"] == "vec"] for name, values in frames.items()}
            stays = {name: values for name, values in own.items() if name != "model"}
            tables["frames"] = {
                name: np.concatenate([values, values]) for name, values in stays.items()
            } | {"model": np.repeat(["nominal", "vec"], len(own["model"]))}
        facts = {each.statistic: each.text for each in facts_of(tables) if each.item == "vec"}
        limits.append(facts["highest_order_set_by"])
    assert limits == ["configurations", "settings"]


def test_what_other_poses_would_show_comes_with_its_cause_and_its_remedy(reflectors):
    from kinacc.calibration.blind_words import WEAK
    from kinacc.calibration.summary_words import half_page
    from kinacc.report.answer import facts_of, read

    def page():
        return " ".join(" ".join(half_page(facts_of(tables), "kinacc fitted own --all")).split())

    tables = read(reflectors)
    open_ = tables["dh_identified"]["status"] == "undetermined"
    tables["dh_identified"]["statement"] = np.where(open_, "a shift of the base is open", None)
    assert "others may" not in page()
    assert "plan-poses" not in page()
    tables["dh_identified"]["statement"][np.flatnonzero(open_)[0]] = f"the tool is open {WEAK}"
    assert page().count("measure such (kinacc plan-poses) or state it (calibration.frames)") == 1
    for joint in range(1, 6):  # the sixth turns the flange about its own axis
        tables["measurements"][f"q{joint}"] = np.full_like(tables["measurements"]["q1"], 0.3)


def test_the_page_says_what_the_half_page_says_in_the_same_bytes_each_time(measured, tmp_path):
    made = [call("report", measured, "--out", tmp_path / f"{n}.html") for n in (1, 2)]
    assert [each.exit_code for each in made] == [0, 0], made[0].output
    content = [(tmp_path / f"{n}.html").read_bytes() for n in (1, 2)]
    assert content[0] == content[1]
    assert len(content[0]) < 3e6
    text, half = html.unescape(content[0].decode()), shown(measured)
    figures = [f"{each:.2f}" for each in figures_of(half, "DH")]
    assert re.search("DH</th>" + "".join(rf'<td class="number">{f}</td>' for f in figures), text)
    assert "http:" not in re.sub(r"<script>.*?</script>", "", text, flags=re.S)


def test_a_page_of_a_folder_without_a_calibration_names_every_table_missing(tmp_path):
    done = call("report", tmp_path)
    assert done.exit_code == 2
    assert "pose_errors.parquet" in done.output
    assert "residuals.parquet" in done.output
    assert not (tmp_path / "report.html").exists()


def test_a_page_about_other_tables_is_found_by_the_check(measured, tmp_path):
    folder = tmp_path / "results" / "own"
    shutil.copytree(measured, folder)
    assert call("report", folder).exit_code == 0
    about = [line for line in call("check-results", folder).output.splitlines() if "html" in line]
    assert about == []
    table = store.read(folder / "worst_rows.parquet")
    table["error_mm"] = table["error_mm"] + 1e-3
    marks = store.read_metadata(folder / "worst_rows.parquet")
    store.write(folder / "worst_rows.parquet", "worst_rows", table, marks)
    said = call("check-results", folder)
    assert said.exit_code == 1
    assert "worst_rows.parquet" in said.output
