"""Tell a whole picture or page from an empty, cut or foreign file."""

from __future__ import annotations

from pathlib import Path

from kinacc.errors import Problem

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"


def check_picture(path: Path) -> list[Problem]:
    """What is wrong with a .svg, .png, .pdf or .html file; nothing if it looks whole."""
    kind = path.suffix[1:]
    is_a = f"a{'n' if kind == 'html' else ''} {kind} {'page' if kind == 'html' else 'picture'}"
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return [Problem(str(path), "no such file")]
    except OSError as error:
        return [Problem(str(path), f"cannot be read: {error.strerror}")]
    if not content:
        return [Problem(str(path), "is empty", is_a)]
    begins, ends = _MARKS[kind](content)
    if not begins:
        return [Problem(str(path), f"is not a {kind} file", is_a)]
    if not ends:
        return [Problem(str(path), "is cut off", f"a whole {is_a.partition(' ')[2]}")]
    return []


def _svg(content: bytes) -> tuple[bool, bool]:
    return b"<svg" in content[:2000], content.rstrip().endswith(b"</svg>")


def _png(content: bytes) -> tuple[bool, bool]:
    return content.startswith(_PNG), content.endswith(_PNG_END)


def _pdf(content: bytes) -> tuple[bool, bool]:
    return content.startswith(b"%PDF-"), b"%%EOF" in content[-1024:]


def _html(content: bytes) -> tuple[bool, bool]:
    return content.startswith(b"<!DOCTYPE html>"), content.rstrip().endswith(b"</html>")


_MARKS = {"svg": _svg, "png": _png, "pdf": _pdf, "html": _html}
