"""What each command prints of one small example; words may change: KINACC_RENEW=1 pytest THIS_FILE.

Decimal numbers, digests, days and the version are left out: other tests hold them.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from command_line import call
from shared_data import SHIPPED
from stages_by_hand import run_stages
from tracked_arm import quickened

import kinacc

HERE = Path(__file__).resolve().parent / "snapshots"
SERIES = SHIPPED / "ur10_tmac/series_B.csv"
FIT, LATER = "results/arm", "results/later"
STAGES = ("measurements", "data_check", "vec", "dh", "residuals", "summary")
NOISE = ("--noise-mm", "0.1")
# In this order, each in the folder that those before it left; the exit code is part of it.
COMMANDS: dict[str, tuple[str, ...]] = {
    "kinacc": ("--help",),
    "init": ("init", "arm.csv", "--robot", "ur10", "--force"),
    "check-data": ("check-data", "arm.yaml"),
    "summary": ("summary", FIT),
    "summary of many": ("summary", "results"),
    "show folder": ("show", FIT),
    "show": ("show", FIT, "residuals"),
    "show --describe": ("show", FIT, "residuals", "--describe"),
    "check-results": ("check-results", "results"),
    "predict": ("predict", FIT, "near.csv"),
    "compensate": ("compensate", FIT, "--program", "near.csv"),
    "export": ("export", FIT, "--out", "exported"),
    "verify": ("verify", "new.yaml", "--calibration", FIT, "--base", "same", "--tool", "same"),
    "compare": ("compare", FIT, LATER),
    "repeatability": ("repeatability", "visits.csv", "--rows", "visits"),
    "plan-poses": ("plan-poses", "ur10", "--poses", "12", "--candidates", "40", "-o", "plan.csv"),
    "campaign plan": ("campaign", "plan", *NOISE, "--candidates", "20", "--budget", "10",
                      "--repetitions", "2"),
    "a word that is no command": ("fit", "arm.yaml"),
    "a file that is not there": ("check-data", "absent.yaml"),
    "a folder without results": ("summary", "nowhere"),
    "a wrong key": ("check-data", "wrong.yaml"),
}  # fmt: skip


def normal(text: str, folder: Path) -> str:
    """The words of an output: without paths of the machine and without what a fit rounds."""
    text = text.replace(str(folder), "FOLDER").replace(kinacc.__version__, "VERSION")
    lines = [line for line in text.splitlines() if not line.endswith(" so far")]
    text = "\n".join(line.rstrip() for line in lines) + "\n"
    text = re.sub(r"\b[0-9a-f]{16,}\b", "DIGEST", text)
    text = re.sub(r"\b20\d\d-\d\d-\d\d(?:[ T]\d\d:\d\d(?::\d\d)?)?", "DAY", text)
    text = re.sub(r"-?\b\d+(?:\.\d+)?e[-+]\d+|-?\b\d+\.\d+", "0.0", text)
    return re.sub(r"(?m)(?<=\S)  +", "  ", text)


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    """Output and exit code of every command, each run once."""
    folder = tmp_path_factory.mktemp("snapshots")
    rows = SERIES.read_text().splitlines(keepends=True)
    few = [rows[0], *rows[1:1496:25]]
    with pytest.MonkeyPatch.context() as here:
        here.chdir(folder)
        here.setenv("COLUMNS", "80")
        Path("arm.csv").write_text("".join(few))
        Path("new.csv").write_text("".join([rows[0], *rows[10:1490:25]]))
        near = [",".join(line.split(",")[:6]) for line in few[:3]]
        Path("near.csv").write_text("\n".join(near) + "\n")
        Path("wrong.yaml").write_text("datasets: {arm: {robot: ur11}}\nstudy: {alhpa: 1}\n")
        visits = [
            f"{pose},{pose + i * 0.01:.2f},{i * 0.02:.2f},{3 - i * 0.01:.2f}"
            for pose in range(6)
            for i in (0, 3, 1, -2)
        ]
        Path("visits.csv").write_text("\n".join(["pose,x_mm,y_mm,z_mm", *visits]) + "\n")
        found = {}
        for name, words in COMMANDS.items():
            done = call(*words)
            text = f"$ kinacc {' '.join(words)}\n{done.output}[exit code {done.exit_code}]\n"
            found[name] = normal(text, folder)
            if name == "init":
                prepare()
    return found


def prepare() -> None:
    """Results of two fits, with models that take no second, and a data set of later poses."""
    text = quickened(Path("arm.yaml"))
    later = text.replace("  arm:", "  later:").replace("arm.csv", "new.csv")
    Path("new.yaml").write_text(later)
    for config, stages in (("arm.yaml", STAGES), ("new.yaml", STAGES[:1] + STAGES[2:])):
        run_stages(stages, [config])


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_prints_what_it_printed(outputs, name):
    path = HERE / (name.replace(" ", "_") + ".txt")
    if os.environ.get("KINACC_RENEW"):
        path.write_text(outputs[name], encoding="utf-8")
    assert outputs[name] == path.read_text(encoding="utf-8"), f"KINACC_RENEW=1 pytest {__file__}"
