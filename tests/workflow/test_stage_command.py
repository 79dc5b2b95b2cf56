"""A stage as the workflow starts it: by a command that any folder and Python can carry out."""

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from snakemake.settings.types import DeploymentMethod
from snakemake.utils import format as in_shell

from kinacc.artifacts.provenance import PACKAGE
from kinacc.workflow.plan import planned
from kinacc.workflow.runner import stage_provenance
from kinacc.workflow.stage import COMMAND, from_words, python_of_stages

WORKFLOW = Path(__file__).parents[2] / "workflow"
MEASURED = """\
datasets:
  own:
    robot: {folder}/my {{robot}}.yaml
    measurements:
      source: file
      file: {{path: {folder}/$HOME poses.csv, columns: {{q1: "1", q2: "J2 [deg]"}}}}
    calibration: {{compliance: {{joints: [2, 3]}}}}
    study: {{chunks: 3}}
"""


@pytest.fixture(params=["the paper's arm", "a measured one"])
def plan(request, tmp_path):
    """A plan of one data set; names of its files would mean something to a shell."""
    if request.param == "the paper's arm":
        return planned([WORKFLOW.parent / "config.yaml"])
    (tmp_path / "my {robot}.yaml").write_bytes(
        (PACKAGE / "kinematics" / "robots" / "mh180.yaml").read_bytes()
    )
    (tmp_path / "$HOME poses.csv").write_text("")
    config = tmp_path / "own.yaml"
    config.write_text(MEASURED.format(folder=tmp_path))
    return planned([config])


def files(given) -> list[str]:
    return [path for each in given for path in ([each] if isinstance(each, str) else each)]


def command(plan, name, dataset, part, gates=()) -> list[str]:
    """What the shell makes of the rule's command, without what comes before its options."""

    class params:
        job = plan.job_text(name, dataset, part)

    text = in_shell(
        COMMAND,
        params=params,
        input=[*gates, *files(plan.inputs(name, dataset).values())],
        output=[
            *plan.outputs(name, dataset, part).values(),
            plan.record(name, dataset, part),
        ],
        log=[plan.log(name, dataset, part)],
    )
    done = subprocess.run(
        ["bash", "-c", text.replace('exec "$KINACC_PYTHON" -P', "exec printf '%s\\0'")],
        capture_output=True,
        text=True,
        check=True,
    )
    words = done.stdout.split("\0")
    return words[words.index("--job") : -1]


def test_every_stage_gets_by_its_command_what_was_planned(plan, monkeypatch):
    monkeypatch.setenv("KINACC_PYTHON", sys.executable)
    (dataset,) = plan.datasets
    for name in plan.stages(dataset):
        part = plan.part_names(name, dataset)[-1]
        wanted = plan.job(name, dataset, part)
        assert from_words(command(plan, name, dataset, part, ["a gate"])) == wanted, name


def test_whoever_carries_a_job_out_says_itself_what_it_runs(plan):
    (dataset,) = plan.datasets
    words = command(plan, "fig1", dataset, None)
    planned = plan.code("fig1", dataset)
    assert any(planned in each for each in words)
    elsewhere = [each.replace(planned, "0" * len(planned)) for each in words]
    assert stage_provenance(from_words(elsewhere), {})["code_hash"] == planned


@pytest.mark.parametrize(
    ("methods", "image", "python"),
    [
        ((), None, sys.executable),
        ((DeploymentMethod.CONDA,), None, "python"),
        ((DeploymentMethod.APPTAINER,), None, sys.executable),
        ((DeploymentMethod.APPTAINER,), "docker://kinacc", "python"),
    ],
)
def test_an_environment_of_conda_or_a_container_brings_its_own_python(methods, image, python):
    deployment = SimpleNamespace(deployment_method=set(methods))
    modifier = SimpleNamespace(global_container_img=image)
    workflow = SimpleNamespace(deployment_settings=deployment, modifier=modifier)
    assert python_of_stages(workflow) == python


def test_the_package_that_planned_is_the_one_that_runs_and_nothing_of_the_folder(tmp_path):
    package = tmp_path / "their code" / "kinacc" / "workflow"
    package.mkdir(parents=True)
    for folder in (package.parent, package):
        (folder / "__init__.py").write_text("")
    (package / "stage.py").write_text("def main(words): import json; print(json.dumps(words))")
    (tmp_path / "json.py").write_text("raise SystemExit('not this one')")
    script = WORKFLOW / "scripts" / "stage.py"
    done = subprocess.run(
        [sys.executable, "-P", script, tmp_path / "their code", "--job", "x"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ('["--job", "x"]\n', "")


STOPPED = """\
import sys, time
from kinacc.artifacts.atomic import replacing
from kinacc.workflow import stage

def half_written(words):
    with replacing(["table"]) as (part,):
        part.write_text("half")
        print("begun", flush=True)
        for _ in range(1200):  # one long sleep outlasts a signal that comes just before it begins
            time.sleep(0.05)

stage.from_words, stage.execute = half_written, print
stage.main([])
"""


@pytest.mark.parametrize("by", [signal.SIGTERM, signal.SIGINT], ids=["SIGTERM", "Ctrl-C"])
def test_a_stage_that_is_told_to_stop_leaves_nothing_half_written(tmp_path, by):
    environment = os.environ | {"PYTHONPATH": str(PACKAGE.parent)}
    started = subprocess.Popen(
        ["bash", "-c", f"exec {shlex.quote(sys.executable)} -c {shlex.quote(STOPPED)}"],
        cwd=tmp_path,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert started.stdout.readline() == "begun\n"
    started.send_signal(by)
    said = started.communicate(timeout=30)[1]
    assert (started.returncode, said, list(tmp_path.iterdir())) == (-by, "", [])


LIBRARIES = """\
import sys
from kinacc.workflow import stage

def libraries(words):
    import scipy.linalg, scipy.special, scipy.optimize
    print(*sorted({"unittest", "numpy.f2py.crackfortran"} & sys.modules.keys()))
    from numpy.testing import assert_allclose
    import numpy.testing
    assert_allclose(numpy.testing.assert_allclose is assert_allclose, True)

stage.from_words, stage.execute = libraries, str
stage.main([])
"""


def test_a_stage_that_uses_scipy_does_not_wait_for_numpys_compiler_and_test_tools():
    done = subprocess.run(
        [sys.executable, "-c", LIBRARIES],
        env=os.environ | {"PYTHONPATH": str(PACKAGE.parent)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("\n", "")
