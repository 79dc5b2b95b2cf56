"""Work that tests share: done once, by whichever of pytest's workers comes first."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest


def once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """A folder that ``make`` has filled; others wait for it, and nobody changes it afterwards."""
    base = factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder, done, over = (base / f"{name}{end}" for end in ("", ".done", ".over"))
    try:
        folder.mkdir()
    except FileExistsError:
        for _ in range(1200):
            if over.exists():
                break
            time.sleep(0.5)
        assert done.exists(), f"{name} could not be made; see the test that asked for it first"
        return folder
    try:
        make(folder)
        done.touch()
    finally:
        over.touch()
    return folder
