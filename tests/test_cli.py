"""The command line as a person uses it: help, one stage by hand, mistakes."""

from pathlib import Path

import pytest
from command_line import answer, call

from kinacc import __version__
from kinacc.cli.group import main


def test_version():
    assert call("--version").output.strip().endswith(__version__)


def commands_of(group, words=()):
    """Words that call each command below a group."""
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        yield (*words, name)
        if hasattr(command, "commands"):
            yield from commands_of(command, (*words, name))


@pytest.mark.parametrize("words", list(commands_of(main)), ids=" ".join)
def test_every_command_has_an_example_of_itself_and_says_its_answer_in_json(words):
    command = main
    for word in words:
        command = command.get_command(None, word)
    shown = call(*words, "--help").output
    assert f"kinacc {' '.join(words)}" in shown.split("Example:")[1]
    if not hasattr(command, "commands"):
        assert "--json" in shown
        assert all(option.help for option in command.params if option.param_type_name == "option")


@pytest.mark.parametrize(
    ("words", "near"),
    [
        (["chek-data"], "check-data"),
        (["campaign", "recrod"], "record"),
        (["init", "x.csv", "--robto", "ur10"], "--robot"),
    ],
)
def test_a_slip_of_the_hand_is_told_what_is_meant(words, near):
    done = call(*words, code=2)
    assert near in done.stderr


@pytest.mark.parametrize(
    "words", [("predict", "nowhere"), ("summary", "nowhere"), ("nonsense",), ("init", "--robto")]
)
def test_what_is_wrong_is_said_as_json_where_the_answer_is_wanted_so(words):
    problems = answer(*words, code=2)["problems"]
    assert all({"where", "what", "allowed", "fix"} == set(each) for each in problems)
    assert problems[0]["what"]


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("check-results results", 2),
        ("check-results results --config wrong.yaml", 2),
        ("add june.csv --to cell.yaml", 2),
        ("summary results", 1),
        ("check-data wrong.yaml", 2),
    ],
)
def test_commands_of_a_build_server_end_with_the_codes_of_the_page(
    tmp_path, monkeypatch, words, code
):
    monkeypatch.chdir(tmp_path)
    Path("cell.yaml").write_text("datasets: {cell: {robot: mh180}}\n")
    Path("wrong.yaml").write_text("datasets: {cell: {robt: mh180}}\n")
    Path("results/cell").mkdir(parents=True)
    Path("results/cell/robot.parquet").write_text("no table")
    call(*words.split(), code=code)
