"""Shared test setup: oracles importable from every folder, property tests repeatable."""

from __future__ import annotations

import sys
from pathlib import Path

from hypothesis import settings

# Works in every pytest import mode, from tests/ and from any folder below it.
sys.path.insert(0, str(Path(__file__).resolve().parent))

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")
