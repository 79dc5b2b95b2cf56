"""Results shared between workflows: found again when all is equal, never when anything is not."""

import shutil
from pathlib import Path

import pytest


def from_cache(text: str, dataset: str) -> set[str]:
    """Tables linked from the cache that this run had not put there itself."""
    return {
        name
        for name in ("vec_model", "dh_model")
        if f"Symlinking output file results/{dataset}/{name}.parquet" in text
        and f"Moving output file results/{dataset}/{name}.parquet" not in text
    }


def fitted_anew(project, cache: Path, dataset: str) -> set[str]:
    """Run the fits from nothing with the shared cache; what was taken from it."""
    shutil.rmtree(project.folder / "results", ignore_errors=True)
    target = f"results/{dataset}/dh_model.parquet"
    text = project.snakemake(target, options=("--cache",), SNAKEMAKE_OUTPUT_CACHE=str(cache))
    return from_cache(text, dataset)


@pytest.fixture(scope="module")
def filled(finished, tmp_path_factory) -> Path:
    """A cache with the fits of both data sets, run in another folder; never changed."""
    folder = tmp_path_factory.mktemp("others")
    project, cache = finished.copied(folder / "their project"), folder / "shared cache"
    cache.mkdir()
    for dataset in ("mh180", "own"):
        assert fitted_anew(project, cache, dataset) == set()
    return cache


@pytest.fixture
def run(project, filled, tmp_path):
    """Run the fits of a data set with a cache that has them already."""
    cache = shutil.copytree(filled, tmp_path / "shared cache")
    return lambda dataset="mh180": fitted_anew(project, cache, dataset)


def test_equal_work_is_taken_from_the_cache(run):
    for dataset in ("mh180", "own"):
        assert run(dataset) == {"vec_model", "dh_model"}


@pytest.mark.parametrize(
    ("file", "line", "left"),
    [
        ("src/kinacc/calibration/dh_fit.py", "# changed", set()),
        ("src/kinacc/calibration/dh_estimator.py", "# changed", {"vec_model"}),
        ("src/kinacc/kinematics/robots/mh180.yaml", "# changed", set()),
        ("src/kinacc/synthetic/accepted_draws.csv", "# changed", set()),
    ],
)
def test_other_code_or_robot_data_is_never_a_hit(project, run, file, line, left):
    project.append(file, line)
    assert run() == left


def test_another_measured_file_is_never_a_hit(project, run):
    path = project.folder / "own data" / "poses.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:-1]) + "\n")
    assert run("own") == set()
