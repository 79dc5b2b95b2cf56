"""What pictures and pages state of the tables they show: the digest of each, by its name."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

from kinacc.artifacts.contract import INPUTS_DIGESTS

# Where each format has a place for it: metadata of SVG, a tEXt chunk of PNG, Info of PDF.
_KEYS = {"svg": "Source", "png": INPUTS_DIGESTS, "pdf": "Keywords"}
_STATED = re.compile(rb"inputs_digests[ \0](\{[^{}]*\})")
_READ = re.compile(rb'<meta name="kinacc:read:([^"]+)" content="([0-9a-f]+)">')


def as_text(digests: Mapping[str, str]) -> str:
    """Digests of inputs by role as tables and pictures state them: JSON, the roles in order."""
    return json.dumps(dict(digests), sort_keys=True, separators=(",", ":"))


def metadata(kind: str, digests: Mapping[str, str]) -> dict[str, str]:
    """Metadata by which a picture of a format states what it was drawn from, for matplotlib."""
    text = as_text(digests)
    return {_KEYS[kind]: text if kind == "png" else f"{INPUTS_DIGESTS} {text}"}


def inputs_digests(kind: str, content: bytes) -> dict[str, str] | None:
    """Digests of what a picture or page was made from, by role; None where it does not say."""
    if kind == "html":
        return {name.decode(): digest.decode() for name, digest in _READ.findall(content)} or None
    found = _STATED.search(content)
    try:
        return found and json.loads(found[1])
    except ValueError:
        return None
