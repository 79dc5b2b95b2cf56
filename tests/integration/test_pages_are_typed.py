"""Every command and every example of Python on the pages is typed as it stands there.

Pages are typed one after another from the top, each in a folder that holds what it assumes: the
reader's own folder after the README has been followed, or a clone with results of the paper's arm
and of two short measured series. They end with the exit code that the page says; what they print is
held by tests/cli/test_snapshots.py. ``KINACC_PAGES_IN_FULL=1`` takes the series whole.
"""

from __future__ import annotations

import json
import os
import shutil
import textwrap
from pathlib import Path

import page_blocks
import pytest
import shared_work
from page_blocks import TYPED, blocks
from typed_commands import ROOT, Shell

from kinacc.tables import store


def name_of(page: Path) -> str:
    """Path of a page from the root of the repository."""
    return page.relative_to(ROOT).as_posix()


PAGES = [
    page
    for page in (
        ROOT / "CONTRIBUTING.md",
        *ROOT.glob("*/README.md"),
        *(ROOT / "docs").rglob("*.md"),
    )
    if any(block.language in TYPED for block in blocks(page))
]
README = ROOT / "README.md"
# Pages that begin in a clone; all others in the reader's folder, as the README leaves it.
IN_A_CLONE = (
    "README.md",
    "CONTRIBUTING.md",
    "config/README.md",
    "docs/campaigns.md",
    "docs/checking-data.md",
    "docs/from-tracker-file-to-compensated-robot.md",
    "docs/planning-poses.md",
    "docs/the-paper.md",
    "docs/using-a-calibration.md",
)
# What else is in the folder in which a page begins.
ASSUMED = {
    "docs/planning-poses.md": """
        cp src/kinacc/kinematics/robots/ur10.yaml my_robot.yaml
        head -300 examples/data/ur10_tmac/series_D.csv | cut -d, -f1-6 > reachable.csv
    """,
    "docs/history.md": "head -120 ../../clone/examples/data/ur10_tmac/series_B.csv > june.csv",
    "docs/questions.md": "cp -r ../../clone/results/ur10_b results/march",
    "docs/using-a-calibration.md": """
        head -5 examples/data/ur10_tmac/series_B.csv | cut -d, -f1-6 > plan.csv
        kinacc predict results/ur10_b plan.csv -o wanted.csv
        kinacc export results/ur10_b --format yaml --out first
        kinacc export results/ur10_d --format yaml --out second
        python -c "
        from kinacc.deployment.export import urdf
        from kinacc.deployment.export.source import Source
        from kinacc.deployment.record import nominal
        from kinacc.kinematics import robot
        print(urdf.text(Source(nominal(robot.load('ur10')), {})))" > my_ur10.urdf
        mv first/ur10_b.yaml before.yaml
        mv second/ur10_d.yaml after.yaml
    """,
}
IN_FULL = bool(os.environ.get("KINACC_PAGES_IN_FULL"))
# Few poses of a series that a page calibrates only to show how, of B with a repeated reading. With
# 103 order 12 is the highest for all of them, and can still be fitted where a fold is left out.
THINNED = {
    "series_B.csv": (*range(1, 1500, 15), 2, 3, 533, 534),
    "series_D.csv": range(1, 620, 6),
}
# The paper's arm as it is, and the two series with models that are fitted in seconds.
SHORT = "".join(
    f"  {name}: {{measurements: {{folds: 2}}, calibration: {{vec: {{order: 2}}}}}}\n"
    for name in ("ur10_b", "ur10_d")
)
PARTS = ("config.yaml", "Snakefile", "workflow", "profiles", "src", "docs", "tools", "config")


@pytest.fixture(scope="session")
def reader(shell, tmp_path_factory) -> Path:
    """What the README leaves: the reader's home, and what went otherwise than it says."""

    def follow(folder: Path) -> None:
        (folder / "a home").mkdir()
        wrong = typed(shell, README, cloned(folder / "clone"), folder / "a home", None)
        (folder / "wrong.json").write_text(json.dumps(wrong))

    return shared_work.once(tmp_path_factory, "reader", follow)


@pytest.fixture(scope="session")
def calibrated(shell, tmp_path_factory) -> Path:
    """A clone with results of the paper's arm and of two short series."""

    def calibrate(folder: Path) -> None:
        clone = cloned(folder / "clone")
        (clone / "short.yaml").write_text(f"datasets:\n{SHORT}")
        words = "kinacc calibrate config.yaml examples/ur10.yaml"
        words += "" if IN_FULL else " short.yaml"
        code, printed, _ = shell(words, clone, HOME=str(folder))
        assert code == 0, printed

    return shared_work.once(tmp_path_factory, "calibrated", calibrate)


def cloned(clone: Path) -> Path:
    """A clone of the repository, with series thinned."""
    shutil.copytree(ROOT / "examples", clone / "examples")
    for name in PARTS:
        (clone / name).symlink_to(ROOT / name)
    for name, kept in THINNED.items() if not IN_FULL else ():
        (path,) = (clone / "examples").rglob(name)
        lines = path.read_text().splitlines(keepends=True)
        path.write_text("".join(lines[number - 1] for number in sorted({*kept})))
    return clone


def typed(shell: Shell, page: Path, start: Path, home: Path, clone: Path | None) -> list[str]:
    """Type a page, from the top, in the folder it starts in; what ended otherwise than it says."""
    wrong, folder = [], start
    for block in blocks(page):
        if "not run" in block.notes or ("only in full" in block.notes and not IN_FULL):
            continue
        if "in a clone" in block.notes:
            folder = clone
        if block.file:
            (folder / block.file).write_text(block.text)
        elif block.language in TYPED:
            dry = {"DRY_RUN": "1"} if "dry run" in block.notes else {}
            text = page_blocks.typed(block)
            code, printed, folder = shell(text, folder, HOME=str(home), **dry)
            if code != block.exit_code:
                wrong.append(f"{block.place} ended with {code}: {text}\n{printed[-3000:]}")
    return wrong


def test_the_readme_leads_from_a_tracker_file_to_models_and_what_they_are_worth(reader):
    assert json.loads((reader / "wrong.json").read_text()) == []
    results = reader / "a home" / "cell" / "results" / "tracker"
    assert list(store.read(results / "dh_model.parquet")["joint"]) == [1, 2, 3, 4, 5, 6]
    assert not (results / "study.parquet").exists()


@pytest.mark.night
@pytest.mark.parametrize("page", [page for page in PAGES if page != README], ids=name_of)
def test_a_page_does_what_it_says(page, shell, calibrated, request, tmp_path):
    home, clone, name = tmp_path / "a home", tmp_path / "clone", name_of(page)
    shutil.copytree(calibrated / "clone", clone, symlinks=True)
    if name in IN_A_CLONE:
        home.mkdir()
        start = clone
    else:
        shutil.copytree(request.getfixturevalue("reader") / "a home", home)
        start = home / "cell"
    assumed = textwrap.dedent(ASSUMED.get(name, ""))
    if name == "docs/the-paper.md":  # of the small study that other tests need as well
        shutil.rmtree(clone / "results")
        shutil.copytree(request.getfixturevalue("finished").folder / "results", clone / "results")
    code, printed, _ = shell(assumed, start, HOME=str(home))
    assert code == 0, printed
    assert typed(shell, page, start, home, clone) == []
