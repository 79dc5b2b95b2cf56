"""Changes by structure: cells, columns, names, units, encodings, trees of YAML, XML and JSON.

Most inputs get one or two changes, so that what reads them goes beyond the first refusal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import PurePath
from typing import Any

from fuzz.packed import parquet, workbook
from fuzz.texts import Random, plain_bytes, table, text
from fuzz.trees import json_text, xml_text, yaml_text


def content(name: str, data: bytes, rng: Random) -> bytes:
    """A file's content, changed as its ending says."""
    change = _BY_ENDING.get(PurePath(name).suffix.lower(), table)
    if rng.random() < 0.06:
        change = plain_bytes
    for _ in range(_few(rng)):
        try:
            data = change(data, rng)
        except Exception:  # no longer of its kind, or beyond what a library writes
            data = (text if rng.random() < 0.7 else plain_bytes)(data, rng)
    return data


def _few(rng: Random) -> int:
    return rng.choice((1, 1, 1, 1, 2, 2, 3, 5))


_BY_ENDING: dict[str, Callable[[bytes, Random], bytes]] = {
    ".yaml": yaml_text,
    ".json": json_text,
    ".urdf": xml_text,
    ".xlsx": workbook,
    ".parquet": parquet,
    **dict.fromkeys((".ls", ".mod", ".jbi", ".log"), text),
}


def chosen(options: dict[str, Sequence], rng: Random, most: int = 2) -> dict[str, Any]:
    """Some of the options, each with one of its values."""
    names = rng.sample(list(options), min(rng.randrange(most + 1), len(options)))
    return {name: rng.choice(list(options[name])) for name in names}
