"""Hashes that decide what reruns: too narrow gives stale results, too wide reruns the world."""

import ast
import importlib.metadata
import importlib.util
from pathlib import Path

import pytest

from kinacc.artifacts import provenance
from kinacc.workflow.catalogue import STAGES

PACKAGE = provenance.PACKAGE
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if "__pycache__" not in path.parts)


def write_package(root: Path, files: dict[str, str]) -> Path:
    """A small package named ``toy`` below ``root``, read anew."""
    for name, content in files.items():
        path = root / "toy" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    provenance.source_tree.cache_clear()
    provenance.closure.cache_clear()
    return root / "toy"


FILES = {
    "__init__.py": "",
    "one.py": "from toy.sub import two\n",
    "sub/__init__.py": "",
    "sub/two.py": "def f():\n    from .three import (\n        a,  # why\n        b,\n    )\n",
    "sub/three.py": "import numpy as np\na = b = 1\n",
    "apart.py": "import toy.sub.data_reader\n",
    "sub/data_reader.py": 'FILE = "numbers.csv"\n',
    "sub/numbers.csv": "1,2\n",
    "arms/small.yaml": "a: 1\n",
    "arm.py": 'FOLDER = "arms"\n',
}


@pytest.mark.parametrize(
    ("changed", "module", "reruns"),
    [
        ("sub/three.py", "toy.one", True),
        ("sub/__init__.py", "toy.one", True),
        ("__init__.py", "toy.apart", True),
        ("apart.py", "toy.one", False),
        ("sub/three.py", "toy.apart", False),
        ("sub/numbers.csv", "toy.apart", True),
        ("sub/numbers.csv", "toy.one", False),
        ("arms/small.yaml", "toy.arm", True),
        ("arms/small.yaml", "toy.apart", False),
    ],
)
def test_a_changed_file_changes_the_hash_of_what_uses_it_alone(tmp_path, changed, module, reruns):
    root = write_package(tmp_path, FILES)
    before = provenance.code_hash(module, root=root)
    root = write_package(tmp_path, {changed: FILES[changed] + "\n# changed\n"})
    assert (provenance.code_hash(module, root=root) != before) == reruns


def test_a_module_that_a_registry_names_counts_where_the_registry_is_used(tmp_path):
    files = {"listed.py": 'PLACES = {"own": "toy.own:Own"}\n', "own.py": "class Own: ...\n"}
    root = write_package(tmp_path, files)
    before = provenance.code_hash("toy.listed", root=root)
    root = write_package(tmp_path, {"own.py": "class Own: ...\n\n# changed\n"})
    assert provenance.code_hash("toy.listed", root=root) != before


def test_a_new_robot_file_changes_what_reads_the_folder(tmp_path):
    root = write_package(tmp_path, FILES)
    before = provenance.code_hash("toy.arm", root=root)
    root = write_package(tmp_path, {"arms/large.yaml": "a: 2\n"})
    assert provenance.code_hash("toy.arm", root=root) != before


def test_another_numpy_changes_the_hash_of_what_uses_numpy(tmp_path, monkeypatch):
    root = write_package(tmp_path, FILES)
    before = {name: provenance.code_hash(name, root=root) for name in ("toy.one", "toy.apart")}
    monkeypatch.setattr(provenance, "_library_version", lambda name: "0.0")
    assert provenance.code_hash("toy.one", root=root) != before["toy.one"]
    assert provenance.code_hash("toy.apart", root=root) == before["toy.apart"]


def test_the_same_package_elsewhere_has_the_same_hash(tmp_path):
    first = write_package(tmp_path / "first place", FILES)
    a = provenance.code_hash("toy.one", root=first)
    second = write_package(tmp_path / "second", FILES)
    assert provenance.code_hash("toy.one", root=second) == a


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_the_scan_finds_every_import_that_ast_finds(path):
    text = path.read_text()
    module = provenance._module_name(path, PACKAGE)
    is_package = path.name == "__init__.py"
    package = module if is_package else module.rpartition(".")[0]
    wanted = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            wanted |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            wanted |= {base} | {f"{base}.{alias.name}" for alias in node.names}
    assert wanted <= provenance.imported_names(text, module, is_package)


def test_every_data_file_of_the_package_is_named_by_a_module():
    provenance.source_tree.cache_clear()
    tree = provenance.source_tree()
    named = frozenset().union(*tree.data.values())
    files = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*")
        if path.is_file() and path.suffix not in (".py", ".pyc", ".nbi", ".nbc")
    }
    assert files == named


@pytest.mark.parametrize("stage", STAGES.values(), ids=lambda stage: stage.name)
def test_every_module_a_stage_loads_counts_in_its_hash(stage):
    """What `import` really loads is within what the hash covers."""
    import subprocess
    import sys

    code = (
        f"import sys, {stage.module}\n"
        "print(*[name for name in sys.modules if name.partition('.')[0] == 'kinacc'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    covered, _ = provenance.closure(stage.module)
    assert set(done.stdout.split()) <= covered


@pytest.mark.parametrize("name", ["matplotlib", "numba", "numpy", "pandas", "pyarrow", "scipy"])
def test_versions_read_from_folder_names_are_those_of_the_metadata(name):
    assert provenance._library_version(name) == importlib.metadata.version(name)


def test_config_hash_depends_on_values_and_not_on_their_order():
    a = provenance.config_hash({"x": {"b": 1.0, "a": [1, 2]}, "y": None})
    assert provenance.config_hash({"y": None, "x": {"a": [1, 2], "b": 1.0}}) == a
    assert provenance.config_hash({"y": None, "x": {"a": [2, 1], "b": 1.0}}) != a


def test_inputs_hash_depends_on_content_and_role(tmp_path):
    (tmp_path / "a").write_bytes(b"1")
    (tmp_path / "b").write_bytes(b"1")
    one, other = provenance.file_hash(tmp_path / "a"), provenance.file_hash(tmp_path / "b")
    assert provenance.inputs_hash({"m": one}) == provenance.inputs_hash({"m": other})
    assert provenance.inputs_hash({"m": one}) != provenance.inputs_hash({"n": one})
