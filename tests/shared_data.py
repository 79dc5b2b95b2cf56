"""Measured data sets: shipped in examples/data, or expected beside the project; golden results.

Tests that need one whose licence is not stated, and which is absent, are skipped. How many were
skipped, and where the data is expected, stands at the end of pytest's report.
"""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
SHIPPED = EXAMPLES / "data"
FOLDER = ROOT.parent / "shared" / "data"
RESULTS = ROOT / "tests" / "golden" / "results"
ABSENT = "measured data absent: "


def place(name: str) -> Path:
    """Where a file or folder of the measured data is, or is expected."""
    return SHIPPED / name if name and (SHIPPED / name).exists() else FOLDER / name


def needed(name: str) -> pytest.MarkDecorator:
    """Mark for tests that need a file or folder of the measured data."""
    path = place(name)
    return pytest.mark.skipif(not path.exists(), reason=f"{ABSENT}{path}")


def path_of(name: str) -> Path:
    """Path of a file of the measured data; skips the test that asks where it is absent."""
    path = place(name)
    if not path.exists():
        pytest.skip(f"{ABSENT}{path}")
    return path
