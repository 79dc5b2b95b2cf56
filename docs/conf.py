"""The site of the pages, as Sphinx builds it: ``make docs``, from the folder of the repository.

The pages stay plain Markdown. What is known anyway is put in: the contents of the site from the
lists of links in index.md, entries of the API from the names in api.md, help of commands, keys
of the configuration and columns of tables from the code (reference.py).
"""

import inspect
import re
import sys
from importlib import import_module
from pathlib import Path

from kinacc import __version__ as release  # noqa: F401

sys.path.insert(0, str(Path(__file__).parent))
import reference

project = "kinacc"
copyright = "the kinacc developers"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "docs/index"
include_patterns = [
    "*.md",
    "docs/**.md",
    "benchmarks/*.md",
    "research/*.md",
    "config/*.md",
    "examples/data/*.md",
]
exclude_patterns = ["docs/_build"]
myst_heading_anchors = 4  # by the same names as on a code host
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]  # types are named, not linked
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
napoleon_use_ivar = True
html_theme = "furo"
html_title = "kinacc"
html_copy_source = False
html_extra_path = ["site/index.html"]
html_static_path = ["site/wide.css"]
html_css_files = ["wide.css"]
html_theme_options = {"light_css_variables": {"code-font-size": "75%"}}

_LISTED = re.compile(r"^- \[([^]]*)\]\(([\w./-]+)\.md\)", re.MULTILINE)
_NAME = re.compile(r"^- `(kinacc\.[\w.]+)`.*\n", re.MULTILINE)


def _made_of_the_page(app: object, page: str, source: list[str]) -> None:
    if page == "docs/index":
        source[0] = "".join(map(_with_contents, re.split(r"^(?=## )", source[0], flags=re.M)))
    if page == "docs/api":
        source[0] = _NAME.sub(_entry, source[0])
    if page == "docs/commands":
        source[0] += reference.commands()
    if page == "docs/configuration":
        source[0] += reference.settings()
    if page == "docs/artifacts":
        source[0] += reference.tables()
    if page == "docs/robots":
        source[0] += reference.robots()


def _with_contents(section: str) -> str:
    title = section.removeprefix("## ").splitlines()[0]
    pages = [f"{name} <{page}>" for name, page in _LISTED.findall(section)]
    if not pages:
        return section
    return "\n".join([section, "```{toctree}", ":hidden:", f":caption: {title}", *pages, "```\n"])


def _entry(match: re.Match) -> str:
    module, _, name = match[1].rpartition(".")
    is_class = inspect.isclass(getattr(import_module(module), name))
    members = "   :members:\n" if is_class and module == "kinacc" else ""
    kind = "class" if is_class else "function"
    return f"```{{eval-rst}}\n.. auto{kind}:: {match[1]}\n{members}```\n\n"


def setup(app):
    """Called by Sphinx."""
    app.connect("source-read", _made_of_the_page)
