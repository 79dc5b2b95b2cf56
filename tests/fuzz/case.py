"""One input of the fuzzer: the files of a folder, and what is said of them beside."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Case:
    """``files``: content by name within a folder. ``options``: plain data for the target's reader.

    ``first`` is the file that the reader is given, and that mutations begin with.
    """

    files: dict[str, bytes]
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def first(self) -> str:
        """The file that is read."""
        return self.options.get("file") or next(iter(self.files))

    def but(self, name: str, content: bytes) -> Case:
        """The case with one file changed."""
        return replace(self, files={**self.files, name: content})

    def write(self, folder: Path) -> None:
        """Put the files where a reader finds them."""
        for name, content in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)

    def to_json(self, target: str, why: str) -> str:
        """The case as a text to keep: files as text where they are some."""
        files = {}
        for name, content in self.files.items():
            try:
                files[name] = content.decode()
            except UnicodeDecodeError:
                files[name] = {"base64": base64.b64encode(content).decode()}
        kept = {"target": target, "why": why, "options": self.options, "files": files}
        return json.dumps(kept, indent=1, ensure_ascii=True) + "\n"

    @classmethod
    def of_json(cls, text: str) -> tuple[str, Case]:
        """The target and the case of a kept text."""
        kept = json.loads(text)
        files = {
            name: content.encode() if isinstance(content, str) else _bytes(content)
            for name, content in kept["files"].items()
        }
        return kept["target"], cls(files, kept["options"])


def _bytes(content: dict[str, str]) -> bytes:
    return base64.b64decode(content["base64"])
