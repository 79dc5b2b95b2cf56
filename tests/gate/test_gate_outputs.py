"""What build servers read of the gate: each form as a server takes it, whatever a file holds."""

from __future__ import annotations

import json
import re
from dataclasses import fields, replace
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import pytest
from command_line import call

from kinacc.errors import InputError
from kinacc.gate import outcome
from kinacc.gate.outcome import Cause, Difference, Outcome, Verdicts
from kinacc.gate.outputs import (
    ENDINGS,
    annotations,
    as_json,
    as_junit,
    as_markdown,
    as_text,
    schema_text,
    written,
)

DATA = Cause("input", "measurements (march.csv)", "a1b2", "c3d4")
KEY = Cause("configuration", "study.repetitions", "100", "200")
NUMBERS = Difference(
    "cell", "residuals", "mean", "other numbers", 2, 9, "dh, validation", 0.12, "mm", 1e-6, (DATA,)
)
VERDICTS = Verdicts(
    results="results",
    accepted="accepted",
    digest="ab" * 32,
    outcomes=(
        Outcome("cell", "held out", "value", "passed", "99 % empirical 0.71 mm, at most 0.8 mm"),
        Outcome("cell", "data", "suspicions", "warned", "2 suspicions", "kinacc check-data a.csv"),
        Outcome("cell", "march", "campaign", "undecided", "neither kept nor broken", "measure on"),
        Outcome(
            "cell",
            "accepted",
            "accepted",
            "failed",
            "2 tables differ from the accepted run",
            "kinacc accept results, if it is meant",
            {"tables": 2, "largest_mm": 0.12, "not_known_mm": float("nan")},
            (NUMBERS, Difference("cell", "dh_model", "", "was edited")),
            "config.yaml",
        ),
    ),
    first_screens={"cell": "ur10 “cell”: 60 poses\nThe calibrated model (DH) misses ..\n"},
)
# What somebody else's file may hold: commands of build servers, control marks, marks of formats.
HOSTILE = (
    "two\nlines\r\n::error::made up",
    "::set-env name=PATH::/tmp",
    "##[add-mask]x ##vso[task.setvariable variable=a]b ##teamcity[x]",
    "\x1b[2J\x07 \x9b0m \u202e turned \x00",
    "a|b `code` </details><script>x</script> <!-- ]]> & &amp; \"'",
    "```\n# heading\n````\n/close\n@all #12 !3",
    "100% 25%0A::error::x;y,z:]",
    "bytes \udcff that are no text \ufffe",
)


def hostile(text: str) -> Verdicts:
    """Verdicts with a text wherever one from a file may stand."""
    cause = Cause("input", text, text, text)
    differences = (
        Difference("cell", "dh_model", text, text, 1, 1, text, 1.0, "mm", 0.0, (cause,)),
        Difference("cell", "residuals", text, text),
    )
    found = [
        Outcome("cell", text, "value", verdict, text, text, {"text": text}, differences, text)
        for verdict in outcome.VERDICTS
    ]
    return Verdicts(text, text, "", tuple(found), {"cell": text})


def schema() -> dict:
    return json.loads(schema_text())


def in_lines_of_a_log(text: str) -> list[str]:
    """Lines that a build server takes for its own commands, whoever wrote them."""
    return [
        line
        for line in re.split("[\n\r\u2028\u2029\x85]", text)
        if line.strip().startswith("::") or re.search(r"##(\[|vso|teamcity)", line)
    ]


def test_a_person_at_a_terminal_sees_what_failed_first_and_what_to_do():
    lines = as_text(VERDICTS, 80).splitlines()
    verdicts = [line.split()[0] for line in lines if line and line[0] != " "]
    assert verdicts[:4] == ["failed", "undecided", "warned", "passed"]
    assert lines[0] == "failed     cell, accepted: 2 tables differ from the accepted run"
    assert "results: failed (1 failed, 1 undecided, 1 warned, 1 passed of 4 gates)" in lines
    assert any(
        line.split() == ["->", "kinacc", "accept", "results,", "if", "it", "is", "meant"]
        for line in lines
    )


def test_what_nothing_explains_stands_before_what_follows_from_new_data():
    told = " ".join(as_text(VERDICTS, 80).split())
    assert told.index("unexplained") < told.index("dh_model: was edited") < told.index("input")
    assert "input changed: measurements (march.csv), a1b2 to c3d4 - residuals.mean" in told
    assert "largest 0.12 mm (1e-06 allowed); 2 of 9 rows, the first: dh, validation" in told


@pytest.mark.parametrize("width", [40, 80, 200])
def test_lines_are_as_wide_as_the_terminal(width):
    lines = as_text(VERDICTS, width).splitlines()
    assert max(map(len, lines[:-1])) <= width  # a digest is never broken
    assert max(map(len, lines)) <= max(width, 64)


def test_hundreds_of_robots_that_pass_do_not_hide_the_one_that_fails():
    passed = [replace(VERDICTS.outcomes[0], dataset=f"arm_{i}") for i in range(500)]
    text = as_text(replace(VERDICTS, outcomes=(*passed, VERDICTS.outcomes[3])), 100)
    assert text.startswith("failed")
    assert "passed     and 460 more" in text
    assert "1 failed, 500 passed of 501 gates" in text


def test_a_program_reads_json_by_the_published_schema():
    checker = jsonschema.Draft202012Validator(schema())
    checker.check_schema(schema())
    said = json.loads(ENDINGS[".json"](VERDICTS))
    checker.validate(said)
    assert said == as_json(VERDICTS)
    assert said["format"] == "kinacc gate 1"
    assert (said["passed"], said["counts"]["failed"]) == (False, 1)
    failed = said["outcomes"][3]
    assert failed["figures"] == {"tables": 2, "largest_mm": 0.12, "not_known_mm": None}
    assert [each["explained"] for each in failed["differences"]] == [True, False]
    checker.validate(as_json(replace(VERDICTS, accepted="", digest="", first_screens={})))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda said: said.pop("digest"),
        lambda said: said.update(more=1),
        lambda said: said["outcomes"][0].update(verdict="fine"),
        lambda said: said["outcomes"][3]["differences"][0].update(largest="0.12 mm"),
        lambda said: said["outcomes"][3]["differences"][0]["causes"][0].update(kind="weather"),
    ],
)
def test_the_schema_refuses_what_the_gate_never_says(wrong):
    said = as_json(VERDICTS)
    wrong(said)
    assert not jsonschema.Draft202012Validator(schema()).is_valid(said)


def test_the_schema_says_what_the_records_say():
    """A field that is added, renamed or dropped changes the format: that is to be decided."""
    known = {name: schema()["$defs"][name] for name in ("outcome", "difference", "cause")}
    records = {"outcome": Outcome, "difference": Difference, "cause": Cause}
    for name, record in records.items():
        named = {each.name for each in fields(record)} | (
            {"explained"} & {*known[name]["required"]}
        )
        assert {*known[name]["properties"]} == {*known[name]["required"]} == named, name
    whole = {each.name for each in fields(Verdicts)} | {
        "format",
        "kinacc_version",
        "passed",
        "counts",
    }
    assert {*schema()["properties"]} == {*schema()["required"]} == whole
    assert set(known["outcome"]["properties"]["verdict"]["enum"]) == set(outcome.VERDICTS)
    kinds = ("CONFIGURATION", "CODE", "VERSION", "INPUT", "SEED", "UNEXPLAINED")
    assert known["cause"]["properties"]["kind"]["enum"] == [getattr(outcome, k) for k in kinds]


def test_the_schema_that_is_published_is_the_one_that_is_installed():
    """`kinacc gate --schema > docs/schemas/gate-1.schema.json` writes it."""
    published = Path(__file__).parents[2] / "docs" / "schemas" / "gate-1.schema.json"
    assert published.read_text(encoding="utf-8") == schema_text()
    assert call("gate", "--schema").output == schema_text()


def test_a_build_server_counts_gates_as_tests():
    root = ElementTree.fromstring(as_junit(VERDICTS).encode())
    (suite,) = root
    for each in (root, suite):
        counted = {name: each.get(name) for name in ("tests", "failures", "errors", "skipped")}
        assert counted == {"tests": "4", "failures": "1", "errors": "0", "skipped": "2"}
    cases = {case.get("name"): case for case in suite}
    assert suite.get("name") == "cell"
    assert {case.get("classname") for case in suite} == {"kinacc.cell"}
    failure = cases["accepted"].find("failure")
    assert failure.get("message") == "2 tables differ from the accepted run"
    assert "input changed: measurements (march.csv)" in failure.text
    assert "What to do: kinacc accept results" in failure.text
    assert cases["accepted"].get("file") == "config.yaml"
    assert cases["data"].find("skipped").get("message") == "warned: 2 suspicions"
    assert cases["march"].find("skipped").get("message").startswith("undecided: ")
    assert [each.tag for each in cases["held out"]] == ["system-out"]


def test_gates_of_several_robots_are_suites_of_their_own():
    other = replace(VERDICTS.outcomes[0], dataset="press")
    whole = replace(VERDICTS.outcomes[0], dataset="")
    root = ElementTree.fromstring(
        as_junit(replace(VERDICTS, outcomes=(*VERDICTS.outcomes, other, whole)))
    )
    assert [(each.get("name"), each.get("tests")) for each in root] == [
        ("cell", "4"),
        ("press", "1"),
        ("results", "1"),
    ]


def test_github_shows_what_did_not_pass_beside_its_file():
    lines = annotations(VERDICTS, "github")
    assert lines[0].startswith("::error file=config.yaml,title=cell%2C accepted::2 tables differ")
    assert lines[1].startswith("::warning file=results,title=cell%2C march::neither")
    assert [line.split(" ")[0] for line in lines] == ["::error", "::warning", "::warning"]


def test_a_gate_without_a_file_is_shown_at_the_table_that_differs():
    unnamed = replace(VERDICTS, outcomes=(replace(VERDICTS.outcomes[3], file=""),))
    (line,) = annotations(unnamed, "plain")
    assert line.startswith("results/cell/residuals.parquet:1: error: cell, accepted: 2 tables")


def test_a_verdict_is_said_once():
    says = "undecided: 12 poses are too few"
    cannot = replace(VERDICTS, outcomes=(replace(VERDICTS.outcomes[2], says=says),))
    assert as_text(cannot, 200).startswith("undecided  cell, march: 12 poses are too few")
    (case,) = ElementTree.fromstring(as_junit(cannot)).iter("testcase")
    assert case.find("skipped").get("message") == says


def test_gitlab_shows_it_as_code_quality():
    (text,) = annotations(VERDICTS, "gitlab")
    entries = json.loads(text)
    for each in entries:
        assert {*each} == {"description", "check_name", "fingerprint", "severity", "location"}
        assert each["location"]["path"]
        assert each["location"]["lines"]["begin"] >= 1
        assert each["severity"] in ("info", "minor", "major", "critical", "blocker")
    assert len({each["fingerprint"] for each in entries}) == 3
    again = json.loads(annotations(replace(VERDICTS, digest="cd" * 32), "gitlab")[0])
    assert [each["fingerprint"] for each in again] == [each["fingerprint"] for each in entries]


def test_azure_and_jenkins_read_lines_of_theirs():
    assert annotations(VERDICTS, "azure")[0].startswith(
        "##vso[task.logissue type=error;sourcepath=config.yaml]cell, accepted: 2 tables differ"
    )
    assert annotations(VERDICTS, "plain")[0].startswith("config.yaml:1: error: cell, accepted: ")


def test_a_summary_has_the_gates_the_causes_and_the_first_screen():
    text = as_markdown(VERDICTS)
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    assert rows[1].startswith("| **failed** | cell | accepted | 2 tables differ")
    assert rows[-1].startswith("| passed | cell | held out | 99 % empirical 0.71 mm")
    assert "**input changed: measurements (march.csv), a1b2 to c3d4**" in text
    assert "```text\nur10 “cell”: 60 poses\nThe calibrated model (DH) misses ..\n```" in text


def test_a_summary_of_a_thousand_robots_is_taken_by_the_servers():
    outcomes = [
        replace(each, dataset=f"arm_{i}") for i in range(1000) for each in VERDICTS.outcomes[:1]
    ]
    screens = {f"arm_{i}": "words\n" * 500 for i in range(1000)}
    text = as_markdown(replace(VERDICTS, outcomes=tuple(outcomes), first_screens=screens))
    assert len(text.encode()) < 1_000_000
    assert re.search(r"First screens of \d+ more data sets are too long", text)


@pytest.mark.parametrize("text", HOSTILE)
class TestTextOfAStranger:
    """A name, a path or a remark from somebody else's file is text in every form."""

    def test_on_the_screen(self, text):
        shown = as_text(hostile(text), 80)
        assert not in_lines_of_a_log(shown)
        assert all(each.isprintable() for line in shown.split("\n") for each in line)

    def test_in_json(self, text):
        written = ENDINGS[".json"](hostile(text))
        assert json.loads(written)["outcomes"][0]["says"] == text
        assert not in_lines_of_a_log(written)
        written.encode("utf-8")

    def test_in_junit(self, text):
        root = ElementTree.fromstring(as_junit(hostile(text)).encode("utf-8"))
        assert [len(suite) for suite in root] == [4]
        assert {each.tag for each in root.iter()} == {
            *("testsuites", "testsuite", "testcase", "failure", "skipped", "system-out")
        }
        for each in root.iter():
            words = "".join([*each.attrib.values(), each.text or ""])
            assert all(mark.isprintable() or mark == "\n" for mark in words)

    def test_in_markdown(self, text):
        lines = as_markdown(hostile(text)).splitlines()
        rows = [line for line in lines if line.startswith("| ")]
        assert len(rows) == 1 + 4
        assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {5}
        begin = lines.index("<details open>")
        head, fenced = lines[:begin], lines[begin + 3 :]
        assert not [line for line in head[1:] if line.startswith(("#", "/")) and line[:4] != "### "]
        assert not re.search(r"(?<!\\)<(?!br>)|[@#!]\w", "\n".join(head))
        fence = fenced[0].removesuffix("text")
        assert set(fence) == {"`"}
        assert [number for number, line in enumerate(fenced) if line == fence] == [len(fenced) - 3]
        assert fenced[-1] == "</details>"

    def test_beside_a_file(self, text):
        for dialect, begin in (("github", "::"), ("azure", "##vso[task.logissue "), ("plain", "")):
            lines = annotations(hostile(text), dialect)
            assert len(lines) == 3
            for line in lines:
                assert line.startswith(begin)
                assert len(line.splitlines()) == 1
                assert not in_lines_of_a_log(line.removeprefix(begin))
        (report,) = annotations(hostile(text), "gitlab")
        assert len(json.loads(report)) == 3


def test_a_command_of_github_ends_where_its_own_marks_end():
    (first, *_) = annotations(hostile("a,title=b::c:d%0Ae"), "github")
    parameters = first.removeprefix("::error ").split("::")[0]
    assert [each.split("=")[0] for each in parameters.split(",")] == ["file", "title"]
    assert "%250A" in first


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_file_is_what_its_ending_says(ending, tmp_path):
    path = tmp_path / "new" / f"gate{ending}"
    written(VERDICTS, path)
    written(VERDICTS, path)
    assert path.read_text(encoding="utf-8") == ENDINGS[ending](VERDICTS)
    assert [each.name for each in path.parent.iterdir()] == [path.name]
    begin = {
        ".xml": "<?xml",
        ".json": "{",
        ".codequality.json": "[",
        ".md": "## ",
        ".txt": "failed",
    }
    assert path.read_text(encoding="utf-8").startswith(begin[ending])


def test_an_ending_that_is_none_is_told_with_those_that_are(tmp_path):
    with pytest.raises(InputError, match=r"\.codequality\.json, \.json, \.xml, \.md, \.txt"):
        written(VERDICTS, tmp_path / "gate.html")
    assert not [*tmp_path.iterdir()]
