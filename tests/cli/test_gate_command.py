"""A pipeline asks `kinacc gate`: by its exit code, on the screen and in files."""

import json
import shutil
from xml.etree import ElementTree

import pytest
from command_line import call

from kinacc.artifacts import records

END = """
measurements: {folds: 2, synthetic: {poses: 60}}
calibration: {vec: {order: 1}}
datasets: {mh180: {robot: mh180}}
"""
GATES = """
tolerance: {mm: 50, of: mean}
gates:
- {name: mean, value: residuals.position.mean}
- {name: not worse, value: residuals.position.mean, against: accepted, allow_mm: 0.02}
- {name: strict, value: residuals.position.mean, at_most_mm: 0.001, on_fail: warn}
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A calibration of a small arm, and the same as the accepted run."""
    base = tmp_path_factory.mktemp("gated")
    (base / "arm.yaml").write_text(GATES + END)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(base)
        for name in ("CI", "GITHUB_ACTIONS", "GITLAB_CI"):
            patch.delenv(name, raising=False)
        done = call("calibrate", "arm.yaml")
        assert done.exit_code == 0, done.output
        done = call("accept", "results", "--reason", "the first")
        assert done.exit_code == 0, done.output
    return base


@pytest.fixture
def cell(made, tmp_path, monkeypatch):
    """A copy of it, in the current folder."""
    shutil.copytree(made, tmp_path / "cell")
    monkeypatch.chdir(tmp_path / "cell")
    return tmp_path / "cell"


def gate(*words, code):
    done = call("gate", "results", "--config", "arm.yaml", *words)
    assert done.exit_code == code, done.output
    return " ".join(done.output.split())


def test_what_holds_passes_and_what_warns_fails_nothing(cell):
    told = gate("--against", "accepted", code=0)
    assert "warned mh180, strict" in told
    assert "passed mh180, mean" in told
    assert "tables are as in the accepted run" in told
    assert told.index("warned") < told.index("passed")


def test_what_does_not_hold_fails_and_files_for_servers_say_so(cell):
    text = (cell / "arm.yaml").read_text()
    (cell / "arm.yaml").write_text(text.replace(", on_fail: warn", ""))
    told = gate("--out", "gate.json", "--out", "gate.xml", "--out", "gate.md", code=1)
    assert told.startswith("failed mh180, strict")
    whole = json.loads((cell / "gate.json").read_text())
    (failed,) = [each for each in whole["outcomes"] if each["verdict"] == "failed"]
    assert (failed["name"], failed["file"]) == ("strict", "arm.yaml")
    assert ElementTree.parse(cell / "gate.xml").find(".//failure") is not None
    assert "strict" in (cell / "gate.md").read_text()


def test_an_edited_table_fails_before_any_gate_looks_at_it(cell):
    other = cell / "results" / "mh180" / "pose_errors.parquet"
    other.write_bytes((cell / "results" / "mh180" / "residuals.parquet").read_bytes())
    told = gate(code=1)
    assert "failed mh180, results" in told
    assert "pose_errors.parquet" in told
    assert "undecided mh180, mean: not looked at: the results do not hold" in told


def test_a_record_that_is_lost_fails(cell):
    (cell / records.place("results/mh180", "residuals")).unlink()
    assert "failed mh180, results" in gate(code=1)


def test_results_of_another_configuration_fail(cell):
    text = (cell / "arm.yaml").read_text()
    (cell / "arm.yaml").write_text(text.replace("order: 1", "order: 2"))
    assert "made with another configuration" in gate(code=1)


def test_an_accepted_run_that_was_edited_cannot_be_used(cell):
    shutil.copy(cell / "results/mh180/residuals.parquet", cell / "accepted/mh180/dh_fit.parquet")
    assert "The accepted run cannot be used" in gate(code=2)


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("--exact",), "--against"),
        (("--out", "gate.pdf"), ".json, .xml, .md"),
        (("--dataset", "nobody"), "mh180"),
        (("--against", "nowhere"), "kinacc accept"),
    ],
)
def test_what_is_asked_wrongly_is_told_before_anything_is_looked_at(cell, words, names):
    assert names in gate(*words, code=2)


def test_results_are_held_to_the_accepted_run_without_a_configuration(cell):
    done = call("gate", "results", "--against", "accepted")
    assert done.exit_code == 0, done.output
    assert "no gate was read" in " ".join(done.output.split())
    done = call("gate", "results")
    assert done.exit_code == 2
    assert "no gate is known" in " ".join(done.output.split())


def test_a_campaign_on_an_earlier_calibration_is_told_from_one_on_this(cell):
    text = GATES + "- {name: bound, campaign: check, tolerance_mm: 90, undecided: warn}\n" + END
    (cell / "arm.yaml").write_text(text)
    told = gate(code=1)
    assert "failed mh180, bound: check/campaign.json no such file" in told
    begun = call(
        *("campaign", "start", "check", "--calibration", "results/mh180", "--drawn", 5),
        *("--noise-mm", 0.05, "--budget", 8),
    )
    assert begun.exit_code == 0, begun.output
    assert "warned mh180, bound: campaign check: undecided" in gate(code=0)
    read_all("check")
    told = gate(code=0)
    assert "passed mh180, bound: campaign check: accept" in told
    (cell / "arm.yaml").write_text(text.replace("90,", "90, confidence: 0.999,"))
    assert "bounds with 95% confidence, and 100% is asked for" in gate(code=1)


def read_all(place):
    """Readings of a campaign, as far off as its arm may be, until it asks for none."""
    for number in range(8):
        row = json.loads(call("campaign", "next", place, "--json").stdout)["rows"][0]
        at = ",".join(str(row[f"expected_{axis}_mm"] + 0.01 * number) for axis in "xyz")
        assert call("campaign", "record", place, f"--position-mm={at}").exit_code == 0


def test_a_tolerance_is_handed_to_campaigns_and_the_summary(cell):
    (cell / "arm.yaml").write_text("tolerance: {mm: 3}" + END)
    done = call("run", "summary", "--config", "arm.yaml")
    assert done.exit_code == 0, done.output
    words = ("campaign", "start", "check", "--calibration", "results/mh180", "--drawn", 5)
    begun = call(*words, "--noise-mm", 0.05, "--budget", 8)
    assert begun.exit_code == 0, begun.output
    assert "tolerance 3 mm: that of the configuration of results/mh180" in begun.output
    assert json.loads((cell / "check/campaign.json").read_text())["limits"]["tolerance_mm"] == 3
    shutil.rmtree(cell / "check")
    rows = json.loads(call("summary", "--json").stdout)["rows"]
    assert (rows[0]["verdict"], rows[0]["tolerance_mm"]) == ("undecided", 3.0)
    assert "(the configuration's tolerance)" in " ".join(call("summary").output.split())
