"""Where faults are planted, in which order, and the source with one planted."""

from __future__ import annotations

import ast
import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mutation.operators import changes, left_alone

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src"
SEED = 15
# The rooms whose faults are planted: what computes, and what checks what was computed.
ROOMS = {
    "kinematics": ("kinematics",),
    "calibration": ("calibration",),
    "assess": ("assess",),
    "artefact check": ("artifacts/store.py", "workflow/verification"),
}


@dataclass(frozen=True)
class Mutant:
    """One planted fault. What names it is code alone: it is found again after lines have moved.

    ``text`` is the line it stands in, the ``nth`` such line of ``function``; ``at`` counts the
    faults that line may have. ``node`` and ``change`` lead to it in the present source.
    """

    module: str
    function: str
    text: str
    nth: int
    at: int
    operator: str
    before: str
    after: str
    line: int
    node: int
    change: int

    @property
    def name(self) -> tuple[str, ...]:
        """What stays the same while the line does."""
        place = (self.module, self.function, self.text, str(self.nth), str(self.at))
        return (*place, self.operator, self.before, self.after)


def path_of(module: str) -> Path:
    """The file of a module."""
    path = SOURCE / Path(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def module_of(path: Path) -> str:
    """The module of a file."""
    name = ".".join(path.relative_to(SOURCE).with_suffix("").parts)
    return name.removesuffix(".__init__")


def room_of(module: str) -> str:
    """The room of ``ROOMS`` a module stands in."""
    place = "/".join(module.split(".")[1:])
    parts = [(room, part.removesuffix(".py")) for room, parts in ROOMS.items() for part in parts]
    return next(room for room, part in parts if f"{place}/".startswith(f"{part}/"))


def modules() -> list[str]:
    """Every module of the rooms."""
    found = []
    for part in (part for parts in ROOMS.values() for part in parts):
        place = SOURCE / "kinacc" / part
        found += sorted(place.rglob("*.py")) if place.is_dir() else [place]
    return [module_of(path) for path in found]


def sequence(seed: int = SEED, within: tuple[str, ...] = ()) -> list[Mutant]:
    """One fault for every line that can have one, in an order that the seed alone decides.

    So the first thousand are a sample in proportion to lines of code, and a line that is edited
    changes only its own place.
    """
    lines: dict[tuple, list[Mutant]] = {}
    for module in within or modules():
        for mutant in mutants(module):
            lines.setdefault((module, mutant.line), []).append(mutant)
    drawn = [min(choices, key=lambda each: _digest(seed, each.name)) for choices in lines.values()]
    return sorted(drawn, key=lambda each: _digest(seed, each.name[:4]))


def mutants(module: str) -> Iterator[Mutant]:
    """Every fault that could be planted in a module."""
    source = path_of(module).read_text()
    text = [line.strip() for line in source.splitlines()]
    tree = ast.parse(source)
    alone, functions = _left_alone(tree), _functions(tree)
    counts: Counter = Counter()
    same: Counter = Counter()
    nth: dict[int, int] = {}
    found = []
    for number, node in enumerate(ast.walk(tree)):
        if node not in alone and hasattr(node, "lineno"):
            found += [
                (node.lineno, number, c, op, new) for c, (op, new) in enumerate(changes(node))
            ]
    nodes = list(ast.walk(tree))
    for line, number, change, operator, new in sorted(found, key=lambda each: each[:3]):
        function, words = functions.get(line, ""), text[line - 1]
        if line not in nth:
            nth[line] = same[function, words]
            same[function, words] += 1
        before, after = _words(nodes[number]), _words(new)
        place = Mutant(module, function, words, nth[line], counts[line], operator, before, after,
                       line, number, change)  # fmt: skip
        counts[line] += 1
        yield place


def planted(mutant: Mutant) -> ast.Module:
    """The module's tree with the fault in place, every line where it was."""
    tree = ast.parse(path_of(mutant.module).read_text())
    node = list(ast.walk(tree))[mutant.node]
    new = list(changes(node))[mutant.change][1]
    for parent in ast.walk(tree):
        for field, value in ast.iter_fields(parent):
            if value is node:
                setattr(parent, field, new)
            elif isinstance(value, list) and any(each is node for each in value):
                value[:] = [new if each is node else each for each in value]
    ast.copy_location(new, node)
    return ast.fix_missing_locations(tree)


def _left_alone(tree: ast.Module) -> set[ast.AST]:
    tops = [child for node in ast.walk(tree) for child in left_alone(node)]
    return {node for top in tops for node in ast.walk(top)}


def _functions(tree: ast.AST, above: str = "") -> dict[int, str]:
    """The innermost function or class of each line."""
    found: dict[int, str] = {}
    for node in ast.iter_child_nodes(tree):
        name = above
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            name = f"{above}.{node.name}" if above else node.name
            found |= dict.fromkeys(range(node.lineno, node.end_lineno + 1), name)
        found |= _functions(node, name)
    return found


def _words(node: ast.AST) -> str:
    """A node as one line of source: the head of what has a body."""
    words = ast.unparse(ast.fix_missing_locations(node))
    return words.splitlines()[0]


def _digest(seed: int, words: tuple[str, ...]) -> str:
    return hashlib.sha256("\x1f".join((str(seed), *words)).encode()).hexdigest()
