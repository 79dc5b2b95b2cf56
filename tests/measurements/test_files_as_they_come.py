"""Measured files as they really come, each through the command line alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from measurements.scoring import FILES, fault, measured


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_read_right_or_asked_about_what_it_leaves_open(name: str, tmp_path: Path) -> None:
    assert fault(measured(name), tmp_path) == ""
