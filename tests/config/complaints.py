"""What is wrong with a configuration, as its reader is told."""

import pytest

from kinacc.checks.configuration import load
from kinacc.errors import InputError


def complaints(*paths, **more) -> list[str]:
    """Every problem that loading the files ends in."""
    with pytest.raises(InputError) as caught:
        load(paths, **more)
    return [str(problem) for problem in caught.value.problems]
