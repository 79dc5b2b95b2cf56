"""Print the size of all tracked Python, room by room; budgets of the parts.

A size is a number of AST nodes without docstrings, so that cramming lines wins nothing; beside it
stand lines. Rules of Snakemake count in lines, pages of ``docs`` written by hand in words.
"""

import ast
import subprocess
from collections import defaultdict
from pathlib import Path

# The most each part may come to: where it stands, its budget, and the unit of the budget.
PARTS = {
    "src and scripts": (("src", "workflow"), 290_000, "nodes"),
    "Snakefile and rules": ((), 650, "lines"),
    "tests": (("tests",), 190_000, "nodes"),
    "tools and benchmarks": (("tools", "benchmarks"), 1500, "lines"),
    "research": (("research",), 4000, "lines"),
    "docs": ((), 25_000, "words"),
}
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def node_count(source):
    """Number of AST nodes of Python source, without docstrings."""
    nodes = list(ast.walk(ast.parse(source)))
    documented = (ast.get_docstring(n, clean=False) for n in nodes if isinstance(n, DOCUMENTED))
    return len(nodes) - 2 * sum(each is not None for each in documented)


def room_of(path):
    """The room that a Python file is counted in."""
    if path.parts[0] == "src":
        return f"src/kinacc/{path.parts[2] if len(path.parts) > 3 else '(top)'}"
    return "workflow/scripts" if path.parts[0] == "workflow" else path.parts[0]


def sizes(top):
    """Nodes and lines of every room, lines of rules by top folder, words of the docs."""
    tracked = subprocess.check_output(["git", "ls-files", "-z"], cwd=top, text=True)
    rooms, rules, words = defaultdict(lambda: [0, 0]), defaultdict(int), 0
    for path in map(Path, filter(None, tracked.split("\0"))):
        if path.suffix not in {"", ".py", ".smk", ".md"} or not (top / path).is_file():
            continue
        source = (top / path).read_text(encoding="utf-8", errors="replace")
        script = source.startswith("#!") and "python" in source.split("\n")[0]
        if path.suffix == ".py" or script:
            rooms[room_of(path)][0] += node_count(source)
            rooms[room_of(path)][1] += len(source.splitlines())
        elif path.suffix == ".smk" or path.name == "Snakefile":
            rules[path.parts[0]] += len(source.splitlines())
        elif path.suffix == ".md" and path.parts[0] == "docs" and "do not edit" not in source:
            words += len(source.split())
    return rooms, rules, words


def main():
    rooms, rules, words = sizes(Path(__file__).resolve().parent.parent)
    totals = {part: [0, 0] for part in PARTS}
    print(f"{'room':24}{'nodes':>10}{'lines':>10}")
    for room, size in sorted(rooms.items()):
        print(f"{room:24}{size[0]:10,}{size[1]:10,}")
        for part, (folders, _, _) in PARTS.items():
            if room.partition("/")[0] in folders:
                totals[part] = [old + new for old, new in zip(totals[part], size, strict=True)]
    totals["research"][1] += rules.pop("research", 0)
    totals["Snakefile and rules"][1] = sum(rules.values())
    for part, (_, budget, unit) in PARTS.items():
        size = f"{words:20,}" if unit == "words" else "{:10,}{:10,}".format(*totals[part])
        print(f"{part:24}{size}{f'{budget:,} {unit}':>16}")


if __name__ == "__main__":
    main()
