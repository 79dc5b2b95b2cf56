"""Tell a whole picture or page from an empty, cut or foreign file, and whose page it is."""

from __future__ import annotations

import re
from pathlib import Path

from kinacc.artifacts.provenance import file_hash
from kinacc.errors import Problem

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"
_READ = re.compile(rb'<meta name="kinacc:read:(\w+)" content="([0-9a-f]+)">')


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
        return [Problem(str(path), "is cut off", is_a.replace(" ", " whole ", 1))]
    return []


def check_page(path: Path) -> list[Problem]:
    """What is wrong with the page of a results folder: not whole, or about other tables."""
    problems = check_picture(path)
    if problems:
        return problems
    read = {name.decode(): digest.decode() for name, digest in _READ.findall(path.read_bytes())}
    tables = {name: path.parent / f"{name}.parquet" for name in read}
    other = [
        name
        for name, table in tables.items()
        if table.is_file() and not file_hash(table).startswith(read[name])
    ]
    if not other:
        return []
    return [Problem(str(path), f"was made from another {', '.join(other)}", "made from these")]


def _svg(content: bytes) -> tuple[bool, bool]:
    return b"<svg" in content[:2000], content.rstrip().endswith(b"</svg>")


def _png(content: bytes) -> tuple[bool, bool]:
    return content.startswith(_PNG), content.endswith(_PNG_END)


def _pdf(content: bytes) -> tuple[bool, bool]:
    return content.startswith(b"%PDF-"), b"%%EOF" in content[-1024:]


def _html(content: bytes) -> tuple[bool, bool]:
    return content.startswith(b"<!DOCTYPE html>"), content.rstrip().endswith(b"</html>")


_MARKS = {"svg": _svg, "png": _png, "pdf": _pdf, "html": _html}
