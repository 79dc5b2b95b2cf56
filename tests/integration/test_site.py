"""The site of the pages: built without a warning, and read without a network."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from shared_data import ROOT

# What a browser loads while it shows a page: an attribute, or the address of a link in the head.
LOADED = re.compile(r'\b(?:src|srcset|poster|data)="([^"]*)"|<link\b[^>]*\bhref="([^"]*)"')


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The site as ``make docs`` builds it."""
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-c", "docs"]
    places = ["-d", str(folder / "read"), ".", str(folder / "site")]
    done = subprocess.run([*build, *places], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "site"


def test_every_page_is_there_and_asks_for_nothing_outside(site):
    pages = list(site.rglob("*.html"))
    names = {page.relative_to(site).as_posix() for page in pages}
    assert {"index.html", "README.html", "docs/index.html", "docs/questions.html"} <= names
    for page in pages:
        loaded = ("".join(each) for each in LOADED.findall(page.read_text(encoding="utf-8")))
        assert [each for each in loaded if re.match(r"(\w+:)?//", each)] == [], page
    for sheet in site.rglob("*.css"):
        loaded = re.findall(r"url\(([^)]*)\)|@import", sheet.read_text(encoding="utf-8"))
        assert [each for each in loaded if re.match(r"[\"']?(https?:)?//", each)] == [], sheet
