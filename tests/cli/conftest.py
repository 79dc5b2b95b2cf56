"""Results that several tests of commands read: made once, and left as they were."""

from __future__ import annotations

import pytest
from command_line import small_study


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """Results folder of a small synthetic study, made by the workflow's own stages."""
    return small_study(tmp_path_factory.mktemp("study"))
