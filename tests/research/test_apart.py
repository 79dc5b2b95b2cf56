"""Research stands apart: its rules run from the repository."""

from __future__ import annotations

import subprocess
import sys

import pandas as pd
from shared_data import ROOT


def snakemake(*arguments: str) -> None:
    command = [sys.executable, "-m", "snakemake", "-c1", "-s", "research/Snakefile", "--nolock"]
    done = subprocess.run([*command, *arguments], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_rules_are_planned_and_a_small_tournament_is_played(tmp_path):
    few = tmp_path / "few.yaml"
    few.write_text(
        f"results: '{tmp_path}'\n"
        "tournament: {size: smoke, parts: 2, assessors: [single_shot, search_and_confirm]}\n"
    )
    snakemake("--configfile", str(few), "-n", "--", "all", f"{tmp_path}/accepted_draws.csv")
    table = tmp_path / "tournament_verdicts.parquet"
    snakemake("--configfile", str(few), "--", str(table), f"{tmp_path}/tournament_coverage.png")
    found = pd.read_parquet(table).query("target == 'measured'").set_index("assessor")
    assert found["statements"].to_dict() == {"single_shot": 40, "search_and_confirm": 40}
    assert found["mean_holds"].min() >= 0.9
