"""docs/pipeline.md followed to the letter, packages installed: ``KINACC_RECIPES_IN_FULL=1``.

It takes the network, a gigabyte of disk and some minutes.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from page_blocks import blocks
from typed_commands import ROOT

from kinacc.gate.accepted import BUILD_SERVERS

PAGE = ROOT / "docs" / "pipeline.md"
SMALL = ROOT / "examples" / "ci" / "paper-small.yaml"
pytestmark = pytest.mark.skipif(
    not os.environ.get("KINACC_RECIPES_IN_FULL"), reason="asked for by KINACC_RECIPES_IN_FULL=1"
)


def not_typed(word: str) -> str:
    """The block of the page that has a word and is typed here alone."""
    (found,) = [each.text for each in blocks(PAGE) if "not run" in each.notes and word in each.text]
    return found


def test_the_small_study_of_the_paper_is_pushed_accepted_and_pushed_again(tmp_path):
    home = tmp_path
    cell, bare = home / "cell", home / "study.git"
    settings = {key: value for key, value in os.environ.items() if key not in BUILD_SERVERS}
    settings |= {"HOME": str(home), "STUDY": SMALL.name, "RUN": "study", "PYTHONPATH": ""}

    def typed(text: str, folder: Path = cell) -> str:
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", text],
            cwd=folder,
            env=settings,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout
        return done.stdout

    def pushed(why: str) -> tuple[str, Path]:
        typed(f"git add -A; git -c user.name=P -c user.email=p@example.com commit -qm {why!r}")
        commit = typed("git rev-parse HEAD").strip()
        said = typed("git push -q ../study.git HEAD:main")
        return said, home / ".cache" / "kinacc-pipeline" / "runs" / commit

    (home / "kinacc").symlink_to(ROOT)
    cell.mkdir()
    shutil.copy(SMALL, cell)
    typed(not_typed("pip wheel"))
    typed(f"git init -q --bare -b main {str(bare)!r}", home)
    shutil.copy(ROOT / "examples" / "ci" / "pipeline.sh", home)
    hook = bare / "hooks" / "post-receive"
    hook.write_text("#!/bin/sh\n" + not_typed("read -r"))
    hook.chmod(0o755)

    said, left = pushed("The study")
    assert "holds no accepted run" in said, said
    (environment,) = (home / ".cache" / "kinacc-pipeline").glob("environment-*")
    accept = f"{str(environment / 'bin' / 'kinacc')!r} accept {str(left / 'results')!r}"
    typed(f"{accept} --reason 'the first run'")
    said, left = pushed("Accept the first run")
    told = json.loads((left / "gate.json").read_text())
    verdicts = {each["verdict"] for each in told["outcomes"]}
    assert verdicts == {"passed"}, said
    assert "Job 1:" not in said, "nothing was to be done"
