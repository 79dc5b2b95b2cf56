"""Work that would take hours or all memory is said before it is begun, with the key to change."""

from __future__ import annotations

import math

import numpy as np
import pytest
from command_line import call, small_study

from kinacc.errors import InputError
from kinacc.workflow import cost, evaluation
from kinacc.workflow.contradictions import load
from kinacc.workflow.plan import planned

BIG = "study: {repetitions: 30000, measurements: 2000}\nevaluation: {points: 2000}\n"


@pytest.fixture
def config(tmp_path):
    """Full settings of the paper's arm with other values at dotted paths."""

    def made(text=""):
        path = tmp_path / "own.yaml"
        path.write_text(f"datasets: {{own: {{robot: mh180}}}}\n{text}")
        return load([path])["own"]

    return made


def test_the_papers_study_is_begun_without_a_word(config, tmp_path):
    config()
    assert cost.expected(cost.foreseen(planned([tmp_path / "own.yaml"]))) == []


def test_a_study_of_hours_is_said_with_its_keys(config, tmp_path):
    config(BIG)
    (said,) = cost.expected(cost.foreseen(planned([tmp_path / "own.yaml"])))
    assert " h of work on one core and 2.3 GB of memory are ahead" in said
    assert "own study_chunk, by study.repetitions, study.measurements, evaluation.points" in said


@pytest.mark.parametrize("here", [True, False])
def test_a_study_beyond_the_memory_of_the_machine_is_refused_where_it_would_run(
    config, tmp_path, monkeypatch, here
):
    config(BIG)
    monkeypatch.setattr(cost, "machine_bytes", lambda: 2e9)
    found = cost.foreseen(planned([tmp_path / "own.yaml"]))
    if not here:
        assert len(cost.expected(found, here=False)) == 1
        return
    with pytest.raises(InputError, match="There is not enough memory") as caught:
        cost.expected(found)
    (problem,) = caught.value.problems
    assert problem.where == "own study_chunk"
    assert "2.3 GB" in problem.what
    assert "2.0 GB" in problem.allowed
    assert "lower study.repetitions or study.measurements or evaluation.points" in problem.fix


def test_what_is_made_is_not_counted_and_other_settings_are(tmp_path, monkeypatch):
    folder = small_study(tmp_path)
    plan = planned([tmp_path / "small.yaml"], results=str(folder.parent))
    monkeypatch.setattr(cost, "LONG_S", 0.0)
    monkeypatch.setattr(cost, "_SHORT_S", 0.0)
    assert not {"vec", "dh", "residuals"} & {name for _, name in cost.foreseen(plan)}
    changed = planned(
        [tmp_path / "small.yaml"], {"calibration": {"vec": {"order": 2}}}, str(folder.parent)
    )
    assert "vec" in {name for _, name in cost.foreseen(changed)}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("plan-campaign", "--noise-mm", 0.1, "--poses", 20, "--errors", "smooth"),
            "--repetitions",
        ),
        (("plan-poses", "ur10", "--drawn", 50, "--poses", 12), "--drawn or --candidates"),
    ],
    ids=["plan-campaign", "plan-poses"],
)
def test_a_command_that_asks_for_too_much_memory_names_its_options(monkeypatch, words, said):
    monkeypatch.setattr(cost, "machine_bytes", lambda: 1e6)
    monkeypatch.setattr(cost, "LARGE_B", 1e5)
    done = call(*words)
    assert done.exit_code == 2, done.output
    assert f"{words[0]}: needs about" in done.output
    assert "which is all there is here" in done.output
    assert said in done.output


def test_a_stage_by_hand_is_refused_before_it_is_begun(tmp_path, monkeypatch):
    folder = small_study(tmp_path)
    monkeypatch.setattr(cost, "machine_bytes", lambda: 1e6)
    monkeypatch.setattr(cost, "LARGE_B", 1e5)
    done = call("run", "dh", "--config", tmp_path / "small.yaml", "--results", folder.parent)
    assert done.exit_code == 2, done.output
    assert "mh180 dh: needs about" in done.output
    assert "lower measurements.synthetic.poses" in done.output


@pytest.mark.parametrize(
    ("groups", "files", "limit"),
    [
        ("0::/a/b\n", {"v2/a/memory.max": "500", "v2/a/b/memory.max": "max"}, 500.0),
        ("5:cpu:/x\n4:memory:/docker/7\n", {"v1/memory.limit_in_bytes": "700"}, 700.0),
        ("0::/a\n", {}, math.inf),
    ],
    ids=["of the group above", "of a container", "none"],
)
def test_the_memory_of_a_container_counts(tmp_path, monkeypatch, groups, files, limit):
    (tmp_path / "groups").write_text(groups)
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"{text}\n")
    monkeypatch.setattr(cost, "_GROUPS", tmp_path / "groups")
    told = {"": (tmp_path / "v2", "memory.max")}
    told["memory"] = (tmp_path / "v1", "memory.limit_in_bytes")
    monkeypatch.setattr(cost, "_LIMITS", told)
    of_machine = cost.machine_bytes()
    assert of_machine == limit or (limit == math.inf and of_machine > 1e8)


def test_estimates_count_the_work_that_is_done(config):
    from kinacc.assess.random_numbers import key_of
    from kinacc.assess.world import drawn_world
    from kinacc.kinematics import region
    from kinacc.study.monte_carlo import assessors, simulate

    own = config("study: {noise_mm: [0.1, 0.2], repetitions: 3, measurements: 4}\n")
    study = own["study"]
    counted = []
    error_mm = np.eye(3) + np.arange(3.0)[:, None]
    visits = type("Visits", (), {"measurements": 4, "visiting_order": "sequence"})()
    every = assessors(study)
    simulate(error_mm, study["noise_mm"], range(3), visits, 1, every,
             lambda jobs, what, total: counted.append(total) or jobs)  # fmt: skip
    assert counted == [cost.simulations(own)]
    assert len(every) == cost._READINGS
    world = drawn_world(error_mm, 0.1, key_of(1, 2, 3), 5)
    assert cost.world_bytes(3, 5) == world.readings_mm.nbytes + world.sizes_mm.nbytes

    grid = region.grid(
        evaluation.cylinder(own["evaluation"]),
        np.deg2rad(own["map"]["slices_deg"]),
        own["map"]["grid_mm"],
    )
    assert cost.cells(own) == len(grid.radius_mm)


@pytest.mark.parametrize(
    ("name", "more", "factor"),
    [
        ("study_chunk", "study: {repetitions: 1000}\n", 10.0),
        ("accuracy_map", "map: {grid_mm: 2.5}\n", 20.0),
        ("residuals", "measurements: {folds: 50}\n", 10.0),
        ("robustness_chunk", "robustness: {draws: 200}\n", 10.0),
    ],
)
def test_an_estimate_grows_with_what_is_asked_for(config, name, more, factor):
    small, large = (cost.of_stage(name, config(text)).seconds for text in ("", more))
    assert factor / 3.0 < large / small < factor * 1.5


def test_times_and_sizes_are_said_in_whole_units():
    times = [cost.in_time(each) for each in (61.0, 119.0, 7000.0, 4e5)]
    assert times == ["61 s", "2 min", "2 h", "5 days"]
    sizes = [cost.in_bytes(each) for each in (3e8, 2.34e9, 2.4e14)]
    assert sizes == ["300 MB", "2.3 GB", "240,000.0 GB"]
