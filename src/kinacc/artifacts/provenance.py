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
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path, PurePath
from typing import Any, NamedTuple

PACKAGE = Path(__file__).resolve().parents[1]
PYTHON = "python"  # among the versions, a name that no library has

# Parsing 60 modules with `ast` takes 0.1 s, twenty times as long; a test holds this scan to `ast`.
# A line feed that has to be there is found twice as fast as the beginning of a line.
_IMPORT = re.compile(
    r"\n[ \t]*(?:from[ \t]+(\.*[\w.]*)[ \t]+import[ \t]*(\([^)]*\)|[^\n#]+)|import[ \t]+([^\n#]+))"
)
_REGISTRY = re.compile(r"([\w.]+):(\w+)(?:\[(\w+)\])?")


class Source(NamedTuple):
    """One file of a package: SHA-256 of its content and, of a module, what it runs.

    ``runs`` are modules of the package (an import runs the packages around a module as well),
    ``libraries`` other packages installed under the name they are imported by.
    """

    digest: bytes
    runs: frozenset[str] = frozenset()
    libraries: frozenset[str] = frozenset()


@dataclass(frozen=True)
class SourceTree:
    """The files of one package, modules by name and data files by their path in the package.

    A file is read when it is asked for: a stage runs a quarter of them.
    """

    root: Path
    files: Mapping[str, Path]
    known: dict[str, Source] = field(default_factory=dict, repr=False, compare=False)

    def __getitem__(self, name: str) -> Source:
        if name not in self.known:
            self.known[name] = self._read(name)
        return self.known[name]

    def _read(self, name: str) -> Source:
        path = self.files[name]
        content = path.read_bytes()
        digest = hashlib.sha256(content).digest()
        if path.suffix != ".py":
            return Source(digest)
        imported = imported_names(content.decode("utf-8"), name, path.name == "__init__.py")
        own = {each for full in (name, *imported) for each in _with_parents(full)}
        libraries = frozenset(own & _installed().keys() - {self.root.name})
        return Source(digest, frozenset(own & self.files.keys()), libraries)


@dataclass(frozen=True)
class Code:
    """What results can depend on besides arguments.

    ``files`` are digests of modules by name and of data files by their path in the package,
    ``versions`` those of the libraries used and of Python.
    """

    files: Mapping[str, str]
    versions: Mapping[str, str]

    def folded(self) -> str:
        """One hash of it all."""
        libraries = sorted(self.versions.keys() - {PYTHON})
        digest = hashlib.sha256(f"{PYTHON} {self.versions[PYTHON]}\n".encode())
        for name in libraries:
            digest.update(f"{name} {self.versions[name]}\n".encode())
        for name in sorted(self.files):
            digest.update(f"{name}\n".encode() + bytes.fromhex(self.files[name]))
        return digest.hexdigest()[:16]


def code_hash(
    *modules: str, uses: Iterable[str] = (), alone: Iterable[str] = (), root: Path = PACKAGE
) -> str:
    """Hash of all that the results of modules can depend on, see :func:`code_of`."""
    return code_of(*modules, uses=uses, alone=alone, root=root).folded()


def code_of(
    *modules: str, uses: Iterable[str] = (), alone: Iterable[str] = (), root: Path = PACKAGE
) -> Code:
    """All that the results of modules can depend on besides their arguments.

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
    names |= {each for each in uses if each in tree.files}
    versions = {name: _library_version(name) for name in libraries}
    versions[PYTHON] = f"{sys.version_info.major}.{sys.version_info.minor}"
    return Code({name: tree[name].digest.hex() for name in names}, versions)


@cache
def stage_code(module: str, uses: tuple[str, ...] = ()) -> Code:
    """The code of a stage, of what reads and writes its files and of the runner.

    ``uses`` is what the stage depends on beside what its module imports, see :func:`code_of`.
    """
    writers = ["kinacc.artifacts.store"]
    if "kinacc.figures" in closure(module)[0]:
        writers.append("kinacc.figures.save")
    around = ("kinacc.workflow.runner", "kinacc.workflow.inputs", "kinacc.artifacts.records")
    return code_of(module, *writers, uses=uses, alone=around)


@cache
def stage_code_hash(module: str, uses: tuple[str, ...] = ()) -> str:
    """Hash of the code of a stage, see :func:`stage_code`."""
    return stage_code(module, uses).folded()


@cache
def closure(module: str, root: Path = PACKAGE) -> tuple[frozenset[str], frozenset[str]]:
    """Names of the package's modules that a module runs, itself included, and its libraries."""
    tree = source_tree(root)
    if module not in tree.files:
        raise LookupError(f"no module {module} in {root.name}")
    seen: set[str] = set()
    waiting = {module}
    while waiting:
        name = waiting.pop()
        seen.add(name)
        waiting |= tree[name].runs - seen
    return frozenset(seen), frozenset().union(*(tree[name].libraries for name in seen))


@cache
def source_tree(root: Path = PACKAGE) -> SourceTree:
    """The files of a package, listed once per process."""
    files = {}
    for folder, within, names in os.walk(root):
        within[:] = [each for each in within if each != "__pycache__"]
        for path in (Path(folder, each) for each in names if not each.startswith(".")):
            is_module = path.suffix == ".py"
            files[_module_name(path, root) if is_module else path.relative_to(root).as_posix()] = (
                path
            )
    return SourceTree(root, files)


def source(module: str, root: Path = PACKAGE) -> str | None:
    """Text of a module of the package; None where there is no such module."""
    path = root.joinpath(*module.split(".")[1:])
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return path.read_text("utf-8") if path.is_file() else None


def imported_names(text: str, module: str, is_package: bool) -> frozenset[str]:
    """Absolute dotted names a module's source imports; `from a import b` gives a and a.b."""
    names: set[str] = set()
    for source, members, plain in _IMPORT.findall("\n" + text):
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
    return hashlib.sha256(_settings_text(settings).encode()).hexdigest()[:16]


def told_settings(settings: Mapping[str, object]) -> dict[str, Any]:
    """Settings as :func:`config_hash` counts them, as plain values."""
    return json.loads(_settings_text(settings))


def _settings_text(settings: Mapping[str, object]) -> str:
    return json.dumps(_placeless(settings), sort_keys=True, ensure_ascii=True)


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
