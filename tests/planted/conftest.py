"""A finished study with an accepted run, to be changed and brought back."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "corruption")]


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    from worlds import finished

    world = finished(tmp_path_factory.mktemp("planted") / "base")
    world.accept()
    return world


@pytest.fixture
def world(base):
    """The finished study, to be changed; it is as it was again afterwards."""
    kept = base.folder / "kept"
    settings = base.configs[1].read_text()
    shutil.copytree(base.results, kept)
    yield base
    shutil.rmtree(base.results)
    kept.rename(base.results)
    base.configs[1].write_text(settings)
