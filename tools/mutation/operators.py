"""The faults that are planted: what a node of the source may become, and where it may not."""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator

COMPARED = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
ARITHMETIC = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
EXTREMES = {
    "min": "max",
    "minimum": "maximum",
    "amin": "amax",
    "nanmin": "nanmax",
    "argmin": "argmax",
    "fmin": "fmax",
    "any": "all",
    "floor": "ceil",
}
EXTREMES |= {after: before for before, after in EXTREMES.items()}
CIRCULAR = {"sin": "cos", "cos": "sin", "arcsin": "arccos", "arccos": "arcsin"}
# Swapping what these are given raises at once or changes nothing: neither proves anything.
NOT_SWAPPED = {"isinstance", "issubclass", "getattr", "hasattr", "partial", "Problem"}
NOT_SWAPPED |= {"min", "max", "minimum", "maximum", "hypot", "array_equal"}
# They save time or refuse mistakes of programmers, and change no result.
WITHOUT_EFFECT = {
    "strict",
    "repr",
    "check_finite",
    "overwrite_a",
    "overwrite_b",
    "overwrite_c",
    "stacklevel",
}


def changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Every (operator, replacement) of one node, in a fixed order."""
    if isinstance(node, ast.Compare):
        for number, op in enumerate(node.ops):
            for other in COMPARED[type(op)]:
                yield "comparison", _with(node, ops=_at(node.ops, number, other()))
    elif isinstance(node, ast.BinOp | ast.AugAssign):
        if type(node.op) in ARITHMETIC:
            yield "arithmetic", _with(node, op=ARITHMETIC[type(node.op)]())
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult) and _differ(node):
            yield "transpose", _with(node, left=node.right, right=node.left)
    elif isinstance(node, ast.UnaryOp):
        if isinstance(node.op, ast.USub):
            yield "sign", node.operand
        elif isinstance(node.op, ast.Not | ast.Invert):
            yield "boolean", node.operand
    elif isinstance(node, ast.BoolOp):
        yield "boolean", _with(node, op=ast.Or() if isinstance(node.op, ast.And) else ast.And())
    elif isinstance(node, ast.If | ast.IfExp | ast.While):
        told_apart = ast.Compare | ast.BoolOp | ast.UnaryOp | ast.Constant
        if not (isinstance(node.test, told_apart) or "TYPE_CHECKING" in ast.dump(node.test)):
            negated = ast.UnaryOp(op=ast.Not(), operand=node.test)
            yield "boolean", _with(node, test=negated)
    elif isinstance(node, ast.Constant):
        for value in _other_values(node.value):
            yield "constant", _with(node, value=value)
    elif isinstance(node, ast.Subscript):
        yield from _subscripts(node)
    elif isinstance(node, ast.Return):
        if node.value is not None and not _is_none(node.value):
            yield "return None", _with(node, value=ast.Constant(value=None))
    elif isinstance(node, ast.Attribute):
        if node.attr == "T":
            yield "transpose", node.value
    elif isinstance(node, ast.Call):
        yield from _calls(node)


def _other_values(value: object) -> Iterator[object]:
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield from (value + 1, value - 1)
    elif isinstance(value, float):
        yield from (value + 1.0, 2.0 * value) if value else (1.0,)


def _subscripts(node: ast.Subscript) -> Iterator[tuple[str, ast.AST]]:
    parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    for number, part in enumerate(parts):
        if not isinstance(part, ast.Slice):
            continue
        for end in ("lower", "upper", "step"):
            if getattr(part, end) is not None:
                new = _at(parts, number, _with(part, **{end: None}))
                whole = _with(node.slice, elts=new) if len(parts) > 1 else new[0]
                yield "slice", _with(node, slice=whole)


def _calls(node: ast.Call) -> Iterator[tuple[str, ast.AST]]:
    name = called(node)
    for family, others in (("min and max", EXTREMES), ("sin and cos", CIRCULAR)):
        if name in others:
            field = "id" if isinstance(node.func, ast.Name) else "attr"
            yield family, _with(node, func=_with(node.func, **{field: others[name]}))
    first = node.args[:2]
    if (
        len(first) == 2
        and name not in NOT_SWAPPED
        and not any(isinstance(arg, ast.Starred) for arg in first)
        and ast.dump(first[0]) != ast.dump(first[1])
    ):
        yield "arguments", _with(node, args=[first[1], first[0], *node.args[2:]])


def called(node: ast.Call) -> str:
    """The last word of what a call calls."""
    return getattr(node.func, "attr", getattr(node.func, "id", ""))


def left_alone(node: ast.AST) -> list[ast.AST]:
    """Children of a node in which nothing is planted: types, words, what checks itself."""
    if isinstance(node, ast.Raise | ast.JoinedStr):
        return list(ast.iter_child_nodes(node))
    alone = [*getattr(node, "decorator_list", [])]
    for field in ("annotation", "returns"):
        alone += [getattr(node, field)] if getattr(node, field, None) is not None else []
    if isinstance(node, ast.Call):
        alone += [word for word in node.keywords if word.arg in WITHOUT_EFFECT]
    if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
        alone += [node.test, *node.body]
    return alone


def _differ(node: ast.BinOp) -> bool:
    return ast.dump(node.left) != ast.dump(node.right)


def _is_none(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


def _at(values: list, number: int, new: object) -> list:
    return [new if each == number else value for each, value in enumerate(values)]


def _with(node: ast.AST, **fields: object) -> ast.AST:
    other = copy.copy(node)
    for name, value in fields.items():
        setattr(other, name, value)
    return other
