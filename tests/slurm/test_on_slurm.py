"""The same workflow on a real Slurm of one node, whose parts are killed: the same bytes."""

from __future__ import annotations

import shutil

TINY_TOURNAMENT = '\nSIZES["default"] = Size((0.1,), {20: (10,)}, 2, 1, (0,))\n'


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


def test_a_tournament_whose_job_is_killed_is_told_done_again_and_ends_as_at_home(project, cluster):
    project.append("src/kinacc/study/tournament/contest.py", TINY_TOURNAMENT)
    project.configure("tournament: {chunks: 2}")
    home = project.copied(project.folder.with_name("home"))
    home.snakemake("tournament")
    log = project.folder / "results" / "tournament" / "logs" / "tournament_chunk.1-of-2.log"
    with cluster.snakemake(project, "tournament") as run:
        run.until(log.exists, "the first part")
        cluster.kill_a_job(cluster.running()[0])
        said = run.finished()
    assert "NODE_FAIL" in said
    assert "slurm_logs" in said
    assert project.digests() == home.digests()
