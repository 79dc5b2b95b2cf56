"""Files of JSON that commands write and read again: what is too much to be read is not read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from kinacc.errors import input_error

_MOST_BYTES, _MOST_VALUES = 100_000_000, 5_000_000  # a second or two, and 500 MB


def bytes_of(path: Path | str) -> bytes:
    """What stands in a file of JSON. Raises InputError where it is larger than any that we write.

    OSError where it cannot be read.
    """
    with open(path, "rb") as stream:
        content = stream.read(_MOST_BYTES + 1)
    if len(content) > _MOST_BYTES:
        allowed = f"at most {_MOST_BYTES // 1_000_000} MB"
        raise input_error(str(path), "is too large", allowed)
    return content


def values_of(content: bytes, name: str) -> Any:
    """The values of a JSON text. Raises InputError where they are too many, ValueError for no JSON.

    ``name`` is what the problem calls it.
    """
    values = sum(map(content.count, (b",", b"[", b"{")))  # at least as many as there are
    if values > _MOST_VALUES:
        allowed = f"at most {_MOST_VALUES:,}"
        raise input_error(name, "holds too many values", allowed)
    return json.loads(content)
