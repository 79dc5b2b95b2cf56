"""Shared test setup: oracles importable from every folder, property tests repeatable."""

from __future__ import annotations

import sys
from pathlib import Path

from hypothesis import settings

# Works in every pytest import mode, from tests/ and from any folder below it.
TESTS = Path(__file__).resolve().parent
sys.path[:0] = [str(TESTS), str(TESTS.parent / "tools")]

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")


def pytest_terminal_summary(terminalreporter):
    """Say how many tests were skipped because measured data is absent, and where it is expected."""
    import shared_data

    reasons = [str(report.longrepr) for report in terminalreporter.stats.get("skipped", ())]
    absent = sum(shared_data.ABSENT in reason for reason in reasons)
    if absent:
        line = f"{absent} skipped: the measured data sets are expected in {shared_data.FOLDER}"
        terminalreporter.write_line(line, yellow=True)
