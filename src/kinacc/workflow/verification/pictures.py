"""Tell a whole picture from an empty, cut or foreign file by its first and last bytes."""

from __future__ import annotations

from pathlib import Path

from kinacc.errors import Problem

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"


def check_picture(path: Path) -> list[Problem]:
    """What is wrong with a .svg, .png or .pdf file; nothing if it looks whole."""
    kind = path.suffix[1:]
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return [Problem(str(path), "no such file")]
    except OSError as error:
        return [Problem(str(path), f"cannot be read: {error.strerror}")]
    if not content:
        return [Problem(str(path), "is empty", f"a {kind} picture")]
    begins, ends = _MARKS[kind](content)
    if not begins:
        return [Problem(str(path), f"is not a {kind} file", f"a {kind} picture")]
    if not ends:
        return [Problem(str(path), "is cut off", f"a whole {kind} picture")]
    return []


def _svg(content: bytes) -> tuple[bool, bool]:
    return b"<svg" in content[:2000], content.rstrip().endswith(b"</svg>")


def _png(content: bytes) -> tuple[bool, bool]:
    return content.startswith(_PNG), content.endswith(_PNG_END)


def _pdf(content: bytes) -> tuple[bool, bool]:
    return content.startswith(b"%PDF-"), b"%%EOF" in content[-1024:]


_MARKS = {"svg": _svg, "png": _png, "pdf": _pdf}
