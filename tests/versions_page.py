"""What docs/versions.md states of floats beside 50 digits."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Stated:
    unit: str
    seen: float
    allowed: float
    why: str = ""


class _Any(dict):
    def __missing__(self, key):
        return Stated("?", 0, 1e9)


STATED = _Any()
