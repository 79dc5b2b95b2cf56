"""Measured data sets, expected beside the project. Tests that need an absent one are skipped.

How many were skipped, and where the data is expected, stands at the end of pytest's report.
"""

from __future__ import annotations

from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data"
ABSENT = "measured data absent: "


def needed(name: str) -> pytest.MarkDecorator:
    """Mark for tests that need a file or folder of the measured data."""
    path = FOLDER / name
    return pytest.mark.skipif(not path.exists(), reason=f"{ABSENT}{path}")


def path_of(name: str) -> Path:
    """Path of a file of the measured data; skips the test that asks where it is absent."""
    path = FOLDER / name
    if not path.exists():
        pytest.skip(f"{ABSENT}{path}")
    return path
