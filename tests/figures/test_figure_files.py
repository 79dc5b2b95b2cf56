"""The files of a figure: same bytes every time, vector text, nothing half-written."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest
from figure_words import figures

from kinacc.figures import save

EACH_WAY = ("fig3", "fig4")  # a map of pixels; assessors, which come as a set


@pytest.fixture(scope="module")
def rendered():
    return {
        name: save.render(figure, save.FORMATS if name in EACH_WAY else ("svg",))
        for name, figure in figures("mh180").items()
    }


def test_another_process_with_other_settings_gives_the_same_bytes(rendered, tmp_path):
    program = (
        "import sys, hashlib; sys.path[:0] = sys.argv[1:]\n"
        "from figure_words import figures\n"
        "from kinacc.figures import save\n"
        f"drawn = figures('mh180', names={EACH_WAY})\n"
        "for name, figure in drawn.items():\n"
        "    for kind, content in save.render(figure, save.FORMATS).items():\n"
        "        print(name, kind, hashlib.sha256(content).hexdigest())\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    own = tmp_path / "matplotlibrc"
    own.write_text("font.size: 20\nlines.linewidth: 9\nsvg.fonttype: none\n")
    known = {"PYTHONHASHSEED": "7", "SOURCE_DATE_EPOCH": "1000000000", "MATPLOTLIBRC": str(own)}
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, Path(__file__).parents[:2])],
        env=os.environ | known, capture_output=True, text=True, check=True,
    )  # fmt: skip
    here = {
        (name, kind, hashlib.sha256(content).hexdigest())
        for name in EACH_WAY
        for kind, content in rendered[name].items()
    }
    assert {tuple(line.split()) for line in done.stdout.splitlines()} == here


def test_files_are_small_and_hold_no_picture_but_the_maps(rendered):
    for name, files in rendered.items():
        assert (b"<image" in files["svg"]) == (name == "fig3")
        assert len(files["svg"]) < 500_000
        assert len(files.get("pdf", "")) < 250_000
