"""Digests of code and settings, by content: what a job depends on beside its files."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path, PurePath

PACKAGE = Path(__file__).resolve().parents[1]
SHOWN = ("figures", "report")  # rooms on which pictures and pages depend, and no table but one:
_SUMMARY = ("report/summary.py", "report/summarise.py")
_LIBRARIES = ("numpy", "scipy", "numba", "pandas", "pyarrow", "matplotlib")


def code_digest(script: Path | str, shown: bool = False) -> str:
    """Digest of a script and of the package: all rooms but cli, or those that draw and show."""
    digest = hashlib.sha256(_package_digest(shown).encode())
    digest.update(Path(script).read_bytes())
    return digest.hexdigest()[:16]


@cache
def _package_digest(shown: bool) -> str:
    versions = [f"{name} {version(name)}" for name in _LIBRARIES]
    digest = hashlib.sha256("\n".join([platform.python_version(), *versions]).encode())
    for path in sorted(PACKAGE.rglob("*")):
        place = path.relative_to(PACKAGE)
        room = place.parts[0]
        if path.suffix in (".pyc", ".nbi", ".nbc") or not path.is_file() or room == "cli":
            continue
        if (room in SHOWN and place.as_posix() not in _SUMMARY) == shown:
            digest.update(place.as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def config_hash(settings: Mapping[str, object]) -> str:
    """Digest of the settings of a stage; files count by name, their contents are inputs."""
    text = json.dumps(_placeless(settings), sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _placeless(settings: object, is_file: bool = False) -> object:
    if isinstance(settings, Mapping):
        return {key: _placeless(item, key in ("robot", "path")) for key, item in settings.items()}
    return PurePath(settings).name if is_file and isinstance(settings, str) else settings
