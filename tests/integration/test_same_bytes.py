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


@pytest.mark.parametrize("stage", ["measurements", "vec", "study_chunk", "study", "fig4"])
def test_a_stage_run_by_hand(project, stage):
    before = project.digests()
    for path in (project.folder / "results" / "mh180").rglob(f"{stage}*"):
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    project.kinacc("run", stage, "--dataset", "mh180")
    assert project.digests() == before
    if stage == "study_chunk":
        assert len(list((project.folder / "results" / "mh180" / "study_chunk").iterdir())) == 2


def test_the_results_pass_the_check(project):
    text = project.kinacc("check-results", "results")
    assert "all is well" in text
