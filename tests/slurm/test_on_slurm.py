"""The same workflow on a real Slurm of one node, whose parts are killed: the same bytes."""

from __future__ import annotations

import shutil


def test_a_study_whose_node_loses_its_daemon_ends_as_at_home(finished, project, cluster):
    shutil.rmtree(project.folder / "results")
    with cluster.snakemake(project) as run:
        models = project.folder / "results" / "mh180" / "vec_model.parquet"
        run.until(models.exists, "the first model")
        cluster.kill("slurmd")
        cluster.start("slurmd")
        said = run.finished()
    assert project.digests() == finished.digests()
    assert said.count("has been submitted with SLURM jobid") == 3  # a data set each, and Fig. 1
