"""The words of ``words.yaml``: a folded text as a set, a list and a mapping as they are."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import yaml


def _read(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _read(each) for key, each in value.items()}
    return frozenset(value.split()) if isinstance(value, str) else value


_TEXT = files(__package__).joinpath("words.yaml").read_text(encoding="utf-8")
_PLAIN = yaml.load(_TEXT, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
WORDS: dict[str, Any] = {
    key: value if key in ("letters", "japanese") else _read(value) for key, value in _PLAIN.items()
}
