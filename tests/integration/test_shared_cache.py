"""Results shared between workflows: found again when all is equal, never when anything is not."""

import shutil

import pytest

TARGET = "results/mh180/dh_model.parquet"


def from_cache(text: str) -> set[str]:
    """Tables linked from the cache that this run had not put there itself."""
    return {
        name
        for name in ("vec_model", "dh_model")
        if f"Symlinking output file results/mh180/{name}.parquet" in text
        and f"Moving output file results/mh180/{name}.parquet" not in text
    }


@pytest.fixture
def run(project, tmp_path):
    """Run the fits from nothing with the shared cache; what was taken from it."""
    cache = tmp_path / "shared cache"
    cache.mkdir()

    def once() -> set[str]:
        shutil.rmtree(project.folder / "results", ignore_errors=True)
        text = project.snakemake(TARGET, options=("--cache",), SNAKEMAKE_OUTPUT_CACHE=str(cache))
        return from_cache(text)

    return once


def test_equal_work_is_taken_from_the_cache(run):
    assert run() == set()
    assert run() == {"vec_model", "dh_model"}


@pytest.mark.parametrize(
    ("file", "line", "left"),
    [
        ("src/kinacc/calibration/dh_fit.py", "# changed", set()),
        ("src/kinacc/stages/dh.py", "# changed", {"vec_model"}),
        ("src/kinacc/robots/mh180.yaml", "# changed", set()),
    ],
)
def test_other_code_or_robot_data_is_never_a_hit(project, run, file, line, left):
    run()
    project.append(file, line)
    assert run() == left
