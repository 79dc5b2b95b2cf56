"""The command line as a person uses it: help, one stage by hand, mistakes."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from kinacc import __version__
from kinacc.cli.group import main
from kinacc.workflow.catalogue import STAGES

ROOT = Path(__file__).resolve().parents[1]
CONFIG = str(ROOT / "config.yaml")


def call(*words: str):
    return CliRunner().invoke(main, [str(word) for word in words])


def test_version():
    assert call("--version").output.strip().endswith(__version__)


@pytest.mark.parametrize(
    "stage",
    STAGES.values(),
    ids=lambda stage: stage.name,
)
def test_help_of_a_stage_says_what_it_reads_and_leaves(stage):
    shown = call("run", stage.name, "--help")
    assert shown.exit_code == 0
    text = " ".join(shown.output.split())
    for name in (*stage.inputs, *stage.outputs, *stage.settings):
        assert name in text


def commands_of(group, words=()):
    """Words that call each command below a group."""
    for name, command in group.commands.items():
        yield (*words, name)
        if hasattr(command, "commands"):
            yield from commands_of(command, (*words, name))


@pytest.mark.parametrize("words", list(commands_of(main)), ids=" ".join)
def test_every_command_has_an_example_of_itself_and_says_its_answer_in_json(words):
    command = main
    for word in words:
        command = command.commands[word]
    shown = call(*words, "--help").output
    assert f"kinacc {' '.join(words)}" in shown.split("Example:")[1]
    if not hasattr(command, "commands"):
        assert "--json" in shown
        assert all(option.help for option in command.params if option.param_type_name == "option")


def test_every_command_is_listed_once_with_all_its_words():
    shown = call("--help").output
    for name in main.commands:
        (line,) = (line for line in shown.splitlines() if line.startswith(f"  {name} "))
        assert not line.endswith("...")


def test_a_stage_says_what_it_wrote(tmp_path):
    done = call("run", "fig1", "--config", CONFIG, "--results", tmp_path)
    paths = [line.removeprefix("written: ") for line in done.stdout.splitlines()]
    assert len(paths) == 3
    assert all(Path(path).is_file() for path in paths)
    again = call("run", "fig1", "--config", CONFIG, "--results", tmp_path, "--json")
    assert json.loads(again.stdout) == {"stage": "fig1", "written": paths}


def test_help_loads_no_numerical_library():
    code = (
        "import sys; from kinacc.cli.group import main\n"
        "try: main(['run', '--help'])\n"
        "except SystemExit: pass\n"
        "print(sorted({'numpy', 'scipy', 'pyarrow', 'numba', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_a_command_loads_no_tools_of_numpy_and_no_compiler(tmp_path):
    code = (
        "import sys; from kinacc.cli.group import main\n"
        f"try: main(['fitted', {str(tmp_path)!r}])\n"
        "except SystemExit: pass\n"
        "import scipy.linalg, scipy.special, numpy as np\n"
        "print(sorted({'unittest', 'numba', 'numpy.f2py.crackfortran'} & set(sys.modules)))\n"
        "np.testing.assert_allclose(1.0, 1.0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_a_figure_that_needs_no_table_is_drawn(tmp_path):
    done = call("run", "fig1", "--config", CONFIG, "--results", tmp_path)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "mh180" / "figures" / "fig1.svg").stat().st_size > 1000


def test_missing_inputs_are_all_named_with_the_command_that_makes_them(tmp_path):
    done = call("run", "fig4", "--config", CONFIG, "--results", tmp_path)
    assert done.exit_code == 2
    assert "study_summary.parquet: no such file" in done.output
    assert "assessment_points.parquet: no such file" in done.output
    assert "kinacc run assessment_points" in done.output
    assert not list(tmp_path.iterdir())


def test_an_unknown_data_set_is_named_beside_the_known_ones(tmp_path):
    done = call("run", "fig1", "--config", CONFIG, "--results", tmp_path, "--dataset", "mh18")
    assert done.exit_code == 2
    assert "'mh18'" in done.output
    assert "mh180" in done.output


def test_a_data_set_must_be_named_where_there_are_two(tmp_path):
    second = tmp_path / "second.yaml"
    second.write_text("datasets: {other: {robot: mh180}}\n")
    done = call("run", "fig1", "--config", CONFIG, "--config", second)
    assert done.exit_code == 2
    assert "mh180, other" in done.output


def test_a_part_that_does_not_exist_is_refused(tmp_path):
    done = call("run", "study_chunk", "--config", CONFIG, "--results", tmp_path, "--part", "3-of-2")
    assert done.exit_code == 2
    assert "1-of-2, 2-of-2" in done.output


def test_a_stage_the_data_set_cannot_go_through_says_why(tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text("evaluation: {space: joint_box}\n")
    done = call("run", "accuracy_map", "--config", CONFIG, "--config", own, "--results", tmp_path)
    assert done.exit_code == 2
    assert "joint_box" in done.output


def test_a_configuration_that_is_not_there(tmp_path):
    done = call("run", "fig1", "--config", tmp_path / "nowhere.yaml")
    assert done.exit_code == 2
    assert "nowhere.yaml: no such file" in done.output
    assert "Traceback" not in done.output


def test_checking_a_folder_that_is_not_there_fails(tmp_path):
    done = call("check-results", tmp_path / "nowhere")
    assert done.exit_code == 1
    assert "no such folder" in done.output


@pytest.mark.parametrize(
    ("tried", "meant"),
    [
        (["inverse", "results/a"], "compensate"),
        (["fit"], "calibrate"),
        (["chek-data"], "check-data"),
        (["campaign", "undo", "check"], "strike"),
        (["campaign", "recrod"], "record"),
        (["measure"], "campaign next"),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_a_word_that_is_no_command_is_told_the_one_that_is_meant(tried, meant):
    done = call(*tried)
    assert done.exit_code == 2
    assert f"Did you mean {meant}?" in done.stderr


def test_an_option_that_is_none_is_told_the_nearest():
    done = call("init", "x.csv", "--robto", "ur10")
    assert done.exit_code == 2
    assert "--robot" in done.stderr


@pytest.mark.parametrize(
    "words", [("predict", "nowhere"), ("fitted", "nowhere"), ("nonsense",), ("init", "--robto")]
)
def test_what_is_wrong_is_said_as_json_where_the_answer_is_wanted_so(words):
    done = call(*words, "--json")
    assert done.exit_code == 2
    problems = json.loads(done.stdout)["problems"]
    assert all({"where", "what", "allowed", "fix"} == set(each) for each in problems)
    assert problems[0]["what"]


@pytest.mark.parametrize(
    "words",
    [
        ("export", "nowhere", "--to", "there"),
        ("check-data", "nowhere.yaml", "--figure", "a.svg"),
        ("predict", "nowhere", "--output=a.csv"),
        ("campaign", "report", "nowhere", "--to", "there"),
    ],
    ids=lambda words: words[0],
)
def test_options_of_the_last_version_still_work_and_say_what_they_are_called_now(words):
    done = call(*words)
    assert " is called --" in done.stderr
    assert "No such option" not in done.stderr
