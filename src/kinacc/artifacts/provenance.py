"""Content hashes that say what an artefact was made from: code, configuration and inputs.

They hold no path, no time and no core or chunk count, so equal work has equal hashes anywhere.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path, PurePath

PACKAGE = Path(__file__).resolve().parents[1]

# Parsing 60 modules with `ast` takes 0.1 s, ten times as long; a test holds this scan to `ast`.
_IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+(\.*[\w.]*)[ \t]+import[ \t]*(\([^)]*\)|[^\n#]+)|import[ \t]+([^\n#]+))",
    re.MULTILINE,
)
_REGISTRY = re.compile(r"([\w.]+):(\w+)(?:\[(\w+)\])?")


@dataclass(frozen=True)
class SourceTree:
    """The files of one package: by file its content, by module what it runs.

    ``digests`` hold modules by name and data files by their path in the package, ``runs`` modules
    of the package (an import runs the packages around a module as well), ``libraries`` other
    packages installed under the name they are imported by.
    """

    digests: Mapping[str, bytes]
    runs: Mapping[str, frozenset[str]]
    libraries: Mapping[str, frozenset[str]]


def code_hash(
    *modules: str, uses: Iterable[str] = (), alone: Iterable[str] = (), root: Path = PACKAGE
) -> str:
    """Hash of all that the results of modules can depend on besides their arguments.

    The modules, every module of the package these import directly or indirectly (imports inside
    functions included), what is declared in ``uses``, the versions of the libraries used, and the
    Python minor version. ``uses`` are data files by their path in the package (one that is not
    there does not count), or registries of modules, ``package.module:MAPPING`` for all that
    a mapping of names to ``package.module:Object`` holds, ``package.module:MAPPING[name]`` for
    one. ``alone`` are modules counted without what they import.
    """
    tree = source_tree(root)
    names, libraries = set(alone), set[str]()
    named = [module for each in uses for module in _registered(each)]
    for module in (*modules, *named):
        reached, used = closure(module, root)
        names |= reached
        libraries |= used
    names |= {each for each in uses if each in tree.digests}
    digest = hashlib.sha256(f"python {sys.version_info.major}.{sys.version_info.minor}\n".encode())
    for name in sorted(libraries):
        digest.update(f"{name} {_library_version(name)}\n".encode())
    for name in sorted(names):
        digest.update(f"{name}\n".encode() + tree.digests[name])
    return digest.hexdigest()[:16]


@cache
def stage_code_hash(module: str, uses: tuple[str, ...] = ()) -> str:
    """Hash of the code of a stage, of what reads and writes its files and of the runner.

    ``uses`` is what the stage depends on beside what its module imports, see :func:`code_hash`.
    """
    writers = ["kinacc.artifacts.store"]
    if "kinacc.figures" in closure(module)[0]:
        writers.append("kinacc.figures.save")
    around = ("kinacc.workflow.runner", "kinacc.workflow.inputs", "kinacc.artifacts.records")
    return code_hash(module, *writers, uses=uses, alone=around)


@cache
def closure(module: str, root: Path = PACKAGE) -> tuple[frozenset[str], frozenset[str]]:
    """Names of the package's modules that a module runs, itself included, and its libraries."""
    tree = source_tree(root)
    if module not in tree.runs:
        raise LookupError(f"no module {module} in {root.name}")
    seen: set[str] = set()
    waiting = {module}
    while waiting:
        name = waiting.pop()
        seen.add(name)
        waiting |= tree.runs[name] - seen
    libraries = frozenset().union(*(tree.libraries[name] for name in seen))
    return frozenset(seen), libraries


@cache
def source_tree(root: Path = PACKAGE) -> SourceTree:
    """Read a package once per process: module contents, imports and package data files."""
    files = sorted(path for path in root.rglob("*") if path.is_file() and _counts(path))
    modules = {_module_name(path, root): path for path in files if path.suffix == ".py"}
    data = {path.relative_to(root).as_posix(): path for path in files if path.suffix != ".py"}
    digests, runs, libraries = {}, {}, {}
    for name, path in modules.items():
        content = path.read_bytes()
        digests[name] = hashlib.sha256(content).digest()
        text, is_package = content.decode("utf-8"), path.name == "__init__.py"
        imported = imported_names(text, name, is_package)
        own = {each for full in (name, *imported) for each in _with_parents(full)}
        runs[name] = frozenset(own & modules.keys())
        libraries[name] = frozenset(own & _installed().keys() - {root.name})
    for name, path in data.items():
        digests[name] = hashlib.sha256(path.read_bytes()).digest()
    return SourceTree(digests, runs, libraries)


def source(module: str, root: Path = PACKAGE) -> str | None:
    """Text of a module of the package; None where there is no such module."""
    path = root.joinpath(*module.split(".")[1:])
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return path.read_text("utf-8") if path.is_file() else None


def imported_names(text: str, module: str, is_package: bool) -> frozenset[str]:
    """Absolute dotted names a module's source imports; `from a import b` gives a and a.b."""
    names: set[str] = set()
    for source, members, plain in _IMPORT.findall(text):
        if plain:
            names |= {item.split()[0] for item in plain.split(",") if item.split()}
            continue
        base = _absolute(source, module, is_package)
        names.add(base)
        listed = re.sub(r"#[^\n]*", "", members).strip("() \t\r\n").split(",")
        names |= {f"{base}.{item.split()[0]}" for item in listed if item.split()}
    return frozenset(names)


def config_hash(settings: Mapping[str, object]) -> str:
    """Hash of the configuration values a stage depends on (which hold no core or chunk count).

    A robot and a measured file count by the name of their file: their contents are among the
    inputs, and where a run is started from does not change what it finds.
    """
    text = json.dumps(_placeless(settings), sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _placeless(settings: object, files: bool = False) -> object:
    """Settings with the folders of the files they name left out."""
    if isinstance(settings, Mapping):
        return {
            key: _placeless(value, files or key in ("robot", "robots", "path"))
            for key, value in settings.items()
        }
    return PurePath(settings).name if files and isinstance(settings, str) else settings


def file_hash(path: Path | str) -> str:
    """Hash of a file's bytes."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def inputs_hash(contents: Mapping[str, str]) -> str:
    """Hash of a stage's inputs, given as artefact or file role -> digest."""
    text = "".join(f"{name} {contents[name]}\n" for name in sorted(contents))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _registered(use: str) -> list[str]:
    """Modules that a registry names; none where ``use`` is a data file."""
    found = _REGISTRY.fullmatch(use)
    if not found:
        return []
    module, mapping, name = found.groups()
    registry = getattr(import_module(module), mapping)
    return [registry[each].partition(":")[0] for each in ([name] if name else registry)]


def _absolute(source: str, module: str, is_package: bool) -> str:
    dots = len(source) - len(source.lstrip("."))
    if not dots:
        return source
    parents = module.split(".")[: len(module.split(".")) - dots + is_package]
    return ".".join([*parents, *filter(None, [source[dots:]])])


def _with_parents(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[:length]) for length in range(1, len(parts) + 1)]


def _module_name(path: Path, root: Path) -> str:
    parts = [root.name, *path.relative_to(root).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _counts(path: Path) -> bool:
    return "__pycache__" not in path.parts and not path.name.startswith(".")


def _library_version(name: str) -> str:
    return _installed()[name]


@cache
def _installed() -> dict[str, str]:
    """Versions by name, from folder names: reading the metadata of five takes 30 ms."""
    found: dict[str, str] = {}
    for folder in filter(os.path.isdir, sys.path):
        for entry in os.listdir(folder):
            if entry.endswith(".dist-info"):
                name, _, number = entry.removesuffix(".dist-info").partition("-")
                found.setdefault(name.lower(), number)
    return found
