"""What does it take to start a command?

Limit: nothing that needs numpy starts faster than ``python -c "import numpy"``, about 0.1 s of
CPU time, nearly all of it reading modules. A command may take 3.5 times that with its work: a
row or a few hundred through a model. Data sets have 120 poses, so that the start is what counts.
``check-data`` fits models to what it checks, which is more than a start.
"""

from __future__ import annotations

import json
import platform
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import project
from harness import Contender, Work

JOINTS = "10,-20,30,0,45,0"


def predict(smoke: bool) -> Callable[[], list[float]]:
    """One row through the selected model; its position."""
    kinacc, cwd = _commands(smoke)
    words = ("predict", "results/arm", "--model", "dh", "--json")
    return lambda: _position(kinacc(*words, "--joints-deg", JOINTS, cwd=cwd))


def compare(smoke: bool) -> Callable[[], list[float]]:
    """A calibration with itself, every parameter and pose; nothing but that it ends well."""
    kinacc, cwd = _commands(smoke)
    return lambda: _nothing(kinacc("compare", "results/arm", "results/arm", cwd=cwd))


def check_data(smoke: bool) -> Callable[[], list[float]]:
    """One measured file, which may look suspicious; nothing but that it ends well."""
    kinacc, cwd = _commands(smoke)
    words = ("check-data", "arm.yaml")
    return lambda: _nothing(kinacc(*words, cwd=cwd, allowed=(0, 1)))


def record(smoke: bool) -> Callable[[], list[float]]:
    """The first reading of a campaign of 20 points, in a fresh copy of it."""
    kinacc, cwd = _commands(smoke)
    begun = project.folder() / "begun"
    kinacc(
        "campaign", "start", begun, "--calibration", "results/arm", "--model", "dh",
        "--drawn", 20, "--budget", 20, "--noise-mm", 0.05, "--frame", "base", cwd=cwd,
    )  # fmt: skip
    point = json.loads(kinacc("campaign", "next", begun, "--json", cwd=cwd))["rows"][0]
    position = ",".join(str(point[f"expected_{axis}_mm"]) for axis in "xyz")
    copies = project.folder()

    def run() -> list[float]:
        campaign = copies / f"campaign{len(list(copies.iterdir()))}"
        shutil.copytree(begun, campaign)
        words = ("campaign", "record", campaign, f"--position-mm={position}")
        return _nothing(kinacc(*words, cwd=cwd))

    return run


def works(smoke: bool) -> list[Work]:
    """A work for each command."""
    import numpy

    import kinacc

    plain = Contender(
        "import numpy", f"{numpy.__version__}, Python {platform.python_version()}",
        lambda: _nothing(project.python("-c", "import numpy", cwd=Path.cwd())),
    )  # fmt: skip
    return [
        Work(
            name, "start", 1, (Contender("kinacc", kinacc.__version__), plain), _agree,
            {plain.name: 1 / 3.5}, today=make, seconds=9.0,
            limit="the start of Python with numpy, which is the other contender",
        )
        for name, make in (
            ("predict", predict), ("compare", compare), ("campaign record", record),
            ("check-data", check_data),
        )
    ]  # fmt: skip


def _commands(smoke: bool) -> tuple[Callable[..., str], Path]:
    """How commands are started, and where: in smoke size they are not, but called."""
    return project.called if smoke else project.kinacc, project.calibrated(40 if smoke else 120)


def _nothing(_: str) -> list[float]:
    return []


def _position(told: str) -> list[float]:
    row = json.loads(told)["rows"][0]
    return [row[f"{axis}_mm"] for axis in "xyz"]


def _agree(outputs: Sequence[list[float]]) -> None:
    """Both kinaccs predict the same to a micrometre; numpy says nothing."""
    told = [each for each in outputs if each]
    if any(abs(a - b) > 1e-3 for each in told for a, b in zip(each, told[0], strict=True)):
        raise ValueError(f"positions differ: {told}")
