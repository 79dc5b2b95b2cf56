"""Hashes that decide what reruns: too narrow gives stale results, too wide reruns the world."""

import ast
import importlib.metadata
import importlib.util
import re
import subprocess
import sys
from dataclasses import replace
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
    "arms/large.yaml": "a: 2\n",
    "arm.py": 'FOLDER = "arms"\n',
    "registry.py": 'METHODS = {"first": "toy.methods.first:F", "other": "toy.methods.other:O"}\n',
    "methods/__init__.py": "",
    "methods/first.py": "from toy.methods import shared\n",
    "methods/other.py": "import scipy\n",
    "methods/shared.py": "",
    "study.py": "from toy import registry\n",
}


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """The hash of a stage of a package that is read anew, with files replaced."""
    monkeypatch.syspath_prepend(str(tmp_path))
    write_package(tmp_path, FILES)

    def hash_of(module: str, *uses: str, **changed: str) -> str:
        root = write_package(tmp_path, changed.get("files", {}))
        return provenance.code_hash(module, uses=uses, root=root)

    yield hash_of
    for name in [name for name in sys.modules if name.partition(".")[0] == "toy"]:
        del sys.modules[name]


@pytest.mark.parametrize(
    ("changed", "module", "uses", "reruns"),
    [
        ("sub/three.py", "toy.one", (), True),
        ("sub/__init__.py", "toy.one", (), True),
        ("__init__.py", "toy.apart", (), True),
        ("apart.py", "toy.one", (), False),
        ("sub/three.py", "toy.apart", (), False),
        ("sub/numbers.csv", "toy.apart", ("sub/numbers.csv",), True),
        ("sub/numbers.csv", "toy.one", (), False),
        ("arms/small.yaml", "toy.arm", ("arms/small.yaml",), True),
        ("arms/large.yaml", "toy.arm", ("arms/small.yaml",), False),
        ("methods/first.py", "toy.study", (), False),
        ("methods/first.py", "toy.study", ("toy.registry:METHODS[first]",), True),
        ("methods/shared.py", "toy.study", ("toy.registry:METHODS[first]",), True),
        ("methods/other.py", "toy.study", ("toy.registry:METHODS[first]",), False),
        ("methods/other.py", "toy.study", ("toy.registry:METHODS",), True),
        ("registry.py", "toy.study", ("toy.registry:METHODS",), True),
    ],
)
def test_a_changed_file_changes_the_hash_of_what_uses_it_alone(toy, changed, module, uses, reruns):
    before = toy(module, *uses)
    after = toy(module, *uses, files={changed: FILES[changed] + "\n# changed\n"})
    assert (after != before) == reruns


def test_a_new_robot_file_changes_nothing_else(toy):
    before = toy("toy.arm", "arms/small.yaml")
    assert toy("toy.arm", "arms/small.yaml", files={"arms/new.yaml": "a: 3\n"}) == before


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


def declared(stage) -> set[str]:
    """Package data files a stage declares, for every shipped robot."""
    robots = [path.stem for path in (PACKAGE / "kinematics" / "robots").glob("*.yaml")]
    return {use for name in robots for use in stage.used({"robot": name, "robots": {"": name}})}


def test_every_data_file_of_the_package_is_declared_by_a_stage_or_is_the_schema():
    files = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*")
        if path.is_file() and path.suffix not in (".py", ".pyc", ".nbi", ".nbc")
    }
    files = {each for each in files if not each.startswith("gate/")}  # above the stages
    named = set().union(*map(declared, STAGES.values()))
    assert files == {use for use in named if ":" not in use} | {"config/schema.yaml"}


@pytest.mark.parametrize("stage", STAGES.values(), ids=lambda stage: stage.name)
def test_every_setting_that_names_code_or_data_reaches_the_stage(stage):
    keys = {key for use in stage.uses for key in re.findall(r"{(\w+)}", use)}
    assert keys <= {*stage.settings, "models", "fits"}  # these follow from the stage itself
    assert (_LOADER in provenance.closure(stage.module)[0]) <= bool(keys)


def test_settings_choose_what_a_stage_uses():
    stage = replace(STAGES["dh"], uses=("a.csv", "{robot}.yaml", "a.b:C[{methods}]"))
    assert stage.used({"robot": "x", "methods": ["m", "n"]}) == (
        "a.csv", "x.yaml", "a.b:C[m]", "a.b:C[n]",
    )  # fmt: skip
    assert stage.used({"robot": "x", "methods": []}) == ("a.csv", "x.yaml", "a.b:C")
    assert stage.used({"robot": {"one": "x", "two": "x"}}) == ("a.csv", "x.yaml")


def test_stages_open_no_data_file_of_the_package_that_they_do_not_declare():
    """What a small arm's stages really open, as the interpreter reports it."""
    done = subprocess.run(
        [sys.executable, "-c", _OPENED], capture_output=True, text=True, check=True
    )
    opened = {line.split()[0]: set(line.split()[1:]) for line in done.stdout.splitlines()}
    assert opened["measurements"] == {
        "kinematics/robots/mh180.yaml",
        "synthetic/accepted_draws.csv",
    }
    for name, files in opened.items():
        assert files <= set(STAGES[name].used({"robot": "mh180"})), name


_LOADER = "kinacc.kinematics.robot.description"
_OPENED = """
import sys
from pathlib import Path
import kinacc
from kinacc.config.schema import defaults
from kinacc.workflow import in_memory
package, opened = Path(kinacc.__file__).parent, set()
def note(event, given):
    path = Path(given[0]) if event == "open" and isinstance(given[0], str) else Path("/")
    if path.suffix in (".yaml", ".csv") and path.is_relative_to(package):
        opened.add(path.relative_to(package).as_posix())
config = defaults() | {"robot": "mh180"}
config["measurements"]["synthetic"]["poses"] = 120
config["measurements"]["folds"] = None
config["calibration"]["vec"]["order"] = 2
config["evaluation"]["points"] = 12
config["map"] |= {"slices_deg": [0], "grid_mm": 400}
config["study"] |= {"noise_mm": [0.1], "repetitions": 1, "measurements": 20}
config["histories"]["simulations_searched"] = 2
sys.addaudithook(note)
tables = {}
for name in in_memory.RUNS:
    opened.clear()
    tables = in_memory.run([name], config, tables)
    print(name, *opened)
"""


@pytest.mark.parametrize("stage", STAGES.values(), ids=lambda stage: stage.name)
def test_every_module_a_stage_loads_counts_in_its_hash(stage):
    """What `import` really loads is within what the hash covers."""
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


def test_config_hash_does_not_depend_on_where_a_run_is_started():
    def hashed(folder, name="poses.csv"):
        file = {"path": f"{folder}{name}", "delimiter": ";"}
        settings = {"robot": f"{folder}arm.yaml", "measurements": {"file": file}}
        return provenance.config_hash(settings | {"robots": {"a": f"{folder}arm.yaml"}})

    assert hashed("") == hashed("../my cell/") == hashed("/home/ours/")
    assert hashed("", "other.csv") != hashed("")


def test_inputs_hash_depends_on_content_and_role(tmp_path):
    (tmp_path / "a").write_bytes(b"1")
    (tmp_path / "b").write_bytes(b"1")
    one, other = provenance.file_hash(tmp_path / "a"), provenance.file_hash(tmp_path / "b")
    assert provenance.inputs_hash({"m": one}) == provenance.inputs_hash({"m": other})
    assert provenance.inputs_hash({"m": one}) != provenance.inputs_hash({"n": one})
