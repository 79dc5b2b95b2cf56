"""However the work is split or started, the bytes are the same."""

import shutil

import pytest


def test_one_core_and_another_number_of_parts(project):
    before = project.digests()
    shutil.rmtree(project.folder / "results")
    project.configure("study: {chunks: 3}")
    project.snakemake("all", cores=1)
    assert project.digests() == before


@pytest.mark.parametrize("chunks", [1, 100])
def test_any_number_of_parts(project, chunks):
    before = project.digests()
    project.configure(f"study: {{chunks: {chunks}}}")
    assert project.to_do()["mh180"] >= {"study_chunk", "study"}
    project.snakemake("results/mh180/study.parquet")
    assert project.digests() == before


@pytest.mark.parametrize(
    ("stage", "made"),
    [
        ("measurements", ["measurements.parquet"]),
        ("vec", ["vec_model.parquet", "vec_frames.parquet", "vec_covariance.parquet"]),
        ("study_chunk", ["study_chunk/1-of-2.parquet", "study_chunk/2-of-2.parquet"]),
        ("study", ["study.parquet", "study_summary.parquet", "readings.parquet"]),
        ("fig4", ["figures/fig4.svg"]),
    ],
)
def test_a_stage_run_by_hand(project, stage, made):
    files = [project.folder / "results" / "mh180" / name for name in made]
    before = [path.read_bytes() for path in files]
    for path in files:
        path.unlink()
    project.kinacc("run", stage, "--dataset", "mh180")
    assert [path.read_bytes() for path in files] == before


def test_the_results_pass_the_check(project):
    text = project.kinacc("check-results", "results")
    assert "all is well" in text
