"""A finished study with an accepted run, made once; each file of tests has a copy to change."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest
import shared_work

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "corruption")]


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Path:
    """Folder of the trials, which nobody changes."""
    from planted import Trials

    return shared_work.once(tmp_path_factory, "planted trials", Trials)


@pytest.fixture(scope="module")
def base(made, tmp_path_factory):
    from worlds import World

    return World(made / "base").copied(tmp_path_factory.mktemp("planted") / "base")


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
