"""What the tests of whole runs share."""

from whole_project import finished, project

__all__ = ["finished", "project"]
