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
