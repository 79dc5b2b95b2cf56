"""A small calibrated arm with a campaign begun, and every command that leaves files there."""

from __future__ import annotations

import shutil
from pathlib import Path

from command_line import call
from whole_project import write_poses

RESULTS = "results/own"
STAGES = ("measurements", "data_check", "vec", "dh", "residuals", "summary")
_CONFIG = ("--config", "own.yaml")
_READING = ("--position-mm", "1,2,3", "--accept-implausible")

# A command, by its words; files it leaves where nothing is wrong.
COMMANDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "init": (
        ("init", "poses.csv", "--robot", "mh180", "--yes", "--name", "fresh", "--out", "new"),
        ("new/fresh.yaml", "new/fresh.robot.yaml"),
    ),
    "check-data": (("check-data", "own.yaml", "--picture", "check.svg"), ("check.svg",)),
    "plan-poses": (
        ("plan-poses", "mh180", "--poses", "12", "-o", "plan.csv", "--picture", "plan.png"),
        ("plan.csv", "plan.png"),
    ),
    "run a table": (("run", "summary", *_CONFIG, "--results", "results"), ()),
    "run several tables": (("run", "residuals", *_CONFIG, "--results", "results"), ()),
    "show": (("show", RESULTS, "residuals"), ()),
    "show -o": (("show", RESULTS, "residuals", "-o", "residuals.csv"), ("residuals.csv",)),
    "check-results": (("check-results", RESULTS), ()),
    "fitted": (("fitted", RESULTS), ()),
    "summary": (("summary", "results", "-o", "fleet.xlsx"), ("fleet.xlsx",)),
    "report": (("report", RESULTS, "--out", "page.html"), ("page.html",)),
    "predict": (("predict", RESULTS, "joints.csv", "-o", "p.csv"), ("p.csv",)),
    "compensate": (("compensate", RESULTS, "wanted.csv", "-o", "c.json"), ("c.json",)),
    "export": (
        ("export", RESULTS, "--out", "exported", "--format", "yaml", "--format", "csv"),
        ("exported/own.csv", "exported/own.yaml"),
    ),
    "verify": (
        ("verify", "own.yaml", "--calibration", RESULTS, "--base", "same", "--tool", "same",
         "-o", "v.parquet"),
        ("v.parquet",),
    ),
    "compare": (
        ("compare", RESULTS, "again/own", "-o", "moved.csv", "--page", "moved.html"),
        ("moved.csv", "moved.html"),
    ),
    "plan-campaign": (
        ("plan-campaign", "--noise-mm", "0.1", "--poses", "20", "--budget", "10",
         "--repetitions", "2", "--picture", "w.pdf", "-o", "w.csv"),
        ("w.pdf", "w.csv"),
    ),
    "campaign start": (
        ("campaign", "start", "more", "--calibration", RESULTS, "--drawn", "10", "--budget", "10",
         "--noise-mm", "0.1"),
        ("more/campaign.json",),
    ),
    "campaign next": (("campaign", "next", "check", "--all", "-o", "next.csv"), ("next.csv",)),
    "campaign record": (("campaign", "record", "check", *_READING), ("check/readings.jsonl",)),
    "campaign status": (("campaign", "status", "check"), ()),
    "campaign report": (("campaign", "report", "check"), ("check/report/report.md",)),
}  # fmt: skip


def inputs(folder: Path) -> None:
    """What a calibration starts from, in a folder, which has to be the one we are in."""
    write_poses(folder / "poses.csv")
    _done("init", "poses.csv", "--robot", "mh180", "--yes", "--name", "own")
    path = folder / "own.yaml"
    text = path.read_text().replace("order: auto", "order: 1")
    path.write_text(text.replace("folds: 5", "folds: 3"))


def build(folder: Path) -> None:
    """Make the world in a folder, which has to be the one we are in."""
    inputs(folder)
    for stage in STAGES:
        _done("run", stage, *_CONFIG)
    shutil.copytree("results", "again")
    joints = ("--columns", "q*", "--csv")
    Path("joints.csv").write_text(_done("show", RESULTS, "measurements", *joints))
    _done("predict", RESULTS, "joints.csv", "-o", "wanted.csv")
    _done("campaign", "start", "check", "--calibration", RESULTS, "--drawn", "10", "--budget", "10",
          "--noise-mm", "0.1")  # fmt: skip
    _done("campaign", "next", "check")
    _done("campaign", "record", "check", *_READING)
    _done("campaign", "next", "check")


def _done(*words: str) -> str:
    result = call(*words)
    assert result.exit_code == 0, f"{words}: {result.output}"
    return result.stdout
