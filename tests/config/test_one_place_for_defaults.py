"""Whoever changes a default or a range changes schema.yaml alone: no code states it again.

The package is searched for values that a key of the schema would take, given to a field, a
parameter, an option or a look-up of the key's name, and for comparisons of what bears the name with
the key's ends or words.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from kinacc.config.schema import Key, plain, settings, walk
from kinacc.config.values import INVALID, check

PACKAGE = Path(__file__).parents[2] / "src" / "kinacc"
# What keys are called where a command or the mathematics has its own word for them.
ALIASES = {"threshold": "truncation", "hayati": "hayati_joints", "parts": "chunks"}
# (file, name): why it is no second default or range of a key.
OTHERS = {
    ("artifacts/store.py", "joints"): "how many an arm has, not which of them bend",
    ("gate/conformity.py", "joints"): "how many an arm has, not which bend",
    ("cli/planned.py", "joints"): "a joint of the arm at hand",
    ("assess/adaptive.py", "measurements"): "the budget of a campaign, which may be larger",
    (
        "calibration/dh_fit.py",
        "loss",
    ): "least squares where no loss is asked; a run asks",
    ("checks/hand_eye.py", "draws"): "random draws of poses, not of the synthetic arm",
    ("cli/choice.py", "seed"): "of a campaign, which no configuration speaks of",
    ("cli/compare.py", "poses"): "poses compared, not poses of the synthetic arm",
    ("cli/plan_campaign.py", "poses"): "poses of simulated campaigns, not of the synthetic arm",
    ("cli/plan_campaign.py", "repetitions"): "of simulated campaigns, not of the study",
    ("cli/plan_poses.py", "poses"): "poses chosen, not poses of the synthetic arm",
}


# Settings of a stage leave keys out that are at their defaults and came after tables of results:
# the reader says what a key that is not there stands for, which has to be what the schema says.
LEFT_OUT = ("measurements/written.py", "measurements/layout.py", "measurements/joining.py")


@dataclass(frozen=True)
class Module:
    """A module of the package with its names: literals, and where imported ones come from."""

    path: Path
    tree: ast.Module

    @property
    def name(self) -> str:
        """As tests and messages call it: the path below the package."""
        return str(self.path.relative_to(PACKAGE))

    def value(self, node: ast.expr | None) -> Any:
        """The value written out there, followed through names of constants; else INVALID."""
        try:
            return ast.literal_eval(node)
        except (ValueError, TypeError, SyntaxError):
            pass
        if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Div, ast.Mult)):
            left, right = self.value(node.left), self.value(node.right)
            if all(isinstance(each, (int, float)) for each in (left, right)):
                return left / right if isinstance(node.op, ast.Div) else left * right
        if isinstance(node, ast.Name):
            return self._named(node.id)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            other = self._imported(node.value.id)
            return other._named(node.attr) if isinstance(other, Module) else INVALID
        return INVALID

    def _named(self, name: str) -> Any:
        for node in self.tree.body:
            targets = getattr(node, "targets", [getattr(node, "target", None)])
            for target in targets if isinstance(node, (ast.Assign, ast.AnnAssign)) else ():
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    pairs = dict(zip(map(name_of, target.elts), node.value.elts, strict=True))
                else:
                    pairs = {name_of(target): node.value}
                if name in pairs:
                    return self.value(pairs[name])
        source = self._imported(name)
        return source if not isinstance(source, Module) else INVALID

    def _imported(self, name: str) -> Any:
        """What a name imported from the package is: a module, or the value of a constant."""
        for node in ast.walk(self.tree):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("kinacc"):
                continue
            for alias in node.names:
                if name == (alias.asname or alias.name):
                    module = modules().get(f"{node.module}.{alias.name}")
                    source = modules().get(node.module)
                    return module or (source._named(alias.name) if source else INVALID)
        return INVALID


@cache
def modules() -> dict[str, Module]:
    """Every module of the package by its dotted name."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = ["kinacc", *path.relative_to(PACKAGE).with_suffix("").parts]
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found[name] = Module(path, ast.parse(path.read_text(encoding="utf-8")))
    return found


@cache
def keys() -> dict[str, list[Key]]:
    """Keys of the schema by their last name, and by what else they are called."""
    found: dict[str, list[Key]] = {}
    for _, key in walk(settings()):
        found.setdefault(key.name, []).append(key)
    return found | {alias: found[name] for alias, name in ALIASES.items()}


def defaults(module: Module) -> Iterator[tuple[int, str, ast.expr]]:
    """Line, name and value of everything that has a default."""
    for node in ast.walk(module.tree):
        if isinstance(node, ast.ClassDef):
            for each in node.body:
                is_field = isinstance(each, ast.AnnAssign) and each.value is not None
                if is_field and not ast.unparse(each.annotation).startswith("ClassVar"):
                    yield each.lineno, each.target.id, each.value
        elif isinstance(node, (ast.FunctionDef, ast.Lambda)):
            names = [*node.args.posonlyargs, *node.args.args]
            with_default = names[len(names) - len(node.args.defaults) :]
            pairs = [*zip(with_default, node.args.defaults, strict=True)]
            pairs += zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
            yield from ((node.lineno, each.arg, value) for each, value in pairs if value)
        elif isinstance(node, ast.Call):
            if name_of(node.func) == "get" and len(node.args) == 2:
                yield node.lineno, str(module.value(node.args[0])), node.args[1]
            for name in option_names(node):
                for each in node.keywords:
                    if each.arg == "default":
                        yield node.lineno, name, each.value


def option_names(call: ast.Call) -> list[str]:
    """What an option of a command is called in Python; nothing for another call."""
    if name_of(call.func) != "option":
        return []
    texts = [each.value for each in call.args if isinstance(each, ast.Constant)]
    return [text.lstrip("-").replace("-", "_") for text in texts]


def second_defaults(module: Module) -> Iterator[tuple[str, str]]:
    """Name and place of every default that a key of that name would take as its value."""
    for line, name, node in defaults(module):
        value = module.value(node) if name in keys() else None
        if value is INVALID or value in (None, (), [], {}):  # nothing is stated
            continue
        same = any(plain(value) == key.default for key in keys()[name])
        if module.name in LEFT_OUT and same:
            continue
        if any(takes(key, value) for key in keys()[name]):
            yield name, f"{module.name}:{line}: default {value!r} of {name}"


def takes(key: Key, value: Any) -> bool:
    """Whether a value could be that of a key."""
    return check(key, plain(value), (), str)[0] is not INVALID


def second_ranges(module: Module) -> Iterator[tuple[str, str]]:
    """Name and place of every check against the ends or the words of the key of that name."""
    checks = checked(module.tree)
    for node in ast.walk(module.tree):
        if node in checks:
            operands = [node.left, *node.comparators]
            names = {name_of(each) for each in operands} & set(keys())
            values = [module.value(each) for each in operands] if names else []
            for name in names:
                for key in keys()[name]:
                    if any(is_end(key, each) or is_words(key, each) for each in values):
                        yield name, f"{module.name}:{node.lineno}: {ast.unparse(node)}"
                        break
        if isinstance(node, ast.Call):
            for name in option_names(node):
                for each in [each.value for each in node.keywords if each.arg == "type"]:
                    given = [module.value(end) for end in getattr(each, "args", ())]
                    for key in keys().get(name, ()):
                        if given == [key.low, key.high] or any(is_words(key, w) for w in given):
                            yield name, f"{module.name}:{node.lineno}: {ast.unparse(each)}"
                            break


def checked(tree: ast.Module) -> set[ast.AST]:
    """Comparisons on which a problem is told."""
    found: set[ast.AST] = set()
    for node in ast.walk(tree):
        tests = [node.test] if isinstance(node, (ast.If, ast.IfExp)) else []
        tests += [test for each in getattr(node, "generators", ()) for test in each.ifs]
        if tests and any(getattr(each, "id", "") == "Problem" for each in ast.walk(node)):
            parts = (each for test in tests for each in ast.walk(test))
            found |= {each for each in parts if isinstance(each, ast.Compare)}
    return found


def name_of(node: ast.expr) -> str:
    """The last part of a name: alpha of self.alpha."""
    return getattr(node, "attr", getattr(node, "id", ""))


def is_end(key: Key, value: Any) -> bool:
    """Whether a number is an end of a key's range."""
    return isinstance(value, (int, float)) and value in (key.low, key.high)


def is_words(key: Key, value: Any) -> bool:
    """Whether a collection holds the words of a key."""
    is_collection = isinstance(value, (tuple, list, dict, set))
    return is_collection and len(key.choices) > 1 and {*map(str, value)} == {*key.choices}


@cache
def in_the_package(search) -> list[tuple[str, str, str]]:
    """Module, name and place of everything a search finds in the package."""
    return [(module.name, *each) for module in modules().values() for each in search(module)]


@pytest.mark.parametrize("search", [second_defaults, second_ranges])
def test_whoever_changes_the_schema_has_changed_it_everywhere(search):
    found = in_the_package(search)
    wrong = [said for module, name, said in found if (module, name) not in OTHERS]
    assert not wrong, "\n".join(["state it in schema.yaml alone:", *wrong])


def test_what_is_said_to_be_another_thing_is_still_there():
    found = in_the_package(second_defaults) + in_the_package(second_ranges)
    assert set(OTHERS) <= {(module, name) for module, name, _ in found}


SECOND = """
import click
from dataclasses import dataclass
from kinacc.errors import InputError, Problem

_WORDS = ("squared", "as_printed")
ALPHA = 0.6

@dataclass
class Settings:
    alpha: float = ALPHA
    eta_ratio_kept: float = 1.023 / 0.906

    def problems(self):
        if not 0.0 < self.alpha < 1.0:
            yield Problem("alpha", f"{self.alpha}", "above 0 and below 1")
        if self.distance not in _WORDS:
            yield Problem("distance", self.distance, ", ".join(_WORDS))

def fit(rows, threshold=1e-2, *, loss="squares"):
    return rows.get("grid_mm", 25.0)

@click.option("--threshold", default=1e-2, type=click.FloatRange(0.0, 1.0, min_open=True))
def command(threshold):
    return threshold
"""


def test_the_search_finds_what_it_is_for():
    module = Module(PACKAGE / "second.py", ast.parse(SECOND))
    names = [name for name, _ in second_defaults(module)]
    assert sorted(names) == sorted(
        ["alpha", "eta_ratio_kept", "threshold", "loss", "grid_mm", "threshold"]
    )
    assert {name for name, _ in second_ranges(module)} == {"alpha", "distance", "threshold"}
