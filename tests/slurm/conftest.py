"""What the tests on a cluster share."""

from __future__ import annotations

import pytest
from single_node import Cluster, needed
from whole_project import finished, project

__all__ = ["finished", "project"]


@pytest.fixture(scope="session")
def cluster(tmp_path_factory):
    needed()
    started = Cluster(tmp_path_factory.mktemp("cluster"))
    yield started
    started.stop()
