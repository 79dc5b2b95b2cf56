"""What the tests of whole runs share."""

import pytest
import shared_work
import typed_commands
from whole_project import finished, project

__all__ = ["finished", "project"]


@pytest.fixture(scope="session")
def shell(tmp_path_factory) -> typed_commands.Shell:
    """A shell in which kinacc is installed from a wheel."""
    site = shared_work.once(tmp_path_factory, "wheel", typed_commands.installed) / "site"
    return typed_commands.Shell(tmp_path_factory.mktemp("shell"), site)
