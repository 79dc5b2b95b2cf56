"""What campaigns and their tables are marked with."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator

from kinacc import __version__
from kinacc.artifacts import provenance
from kinacc.artifacts.contract import INPUTS_DIGESTS
from kinacc.artifacts.pictures import as_text
from kinacc.assess.adaptive import AdaptiveAssessor
from kinacc.campaign.folder import Opened

# An assessor answers by these modules; kinematics and readers hand it numbers.
_ANSWERS = ("kinacc.assess.", "kinacc.distributions")

# Marks of version 0.1.0 before its modules had moved into rooms, with Python 3.11, 3.12 and 3.13
# and the locked libraries. They held library versions, names of modules and readers of files as
# well; in the assessors nothing changed meanwhile but imports and docstrings.
_BEFORE_ROOMS = frozenset(
    {
        "a16405ddfdb8c763",
        "2d424c37494f0530",
        "4ba485643600fc5a",
        "46201217e23bd940",
        "33cba33e6a79bd52",
        "74751ade075534db",
        "9e0f0a25b1a203cc",
        "ebf908d20f5bf128",
        "6eb6563d3bed565f",
        "dd0931a569e98be4",
        "90aa4f67ab47dba5",
        "d6c7d7e4eb82b1a6",
        "21e8ee08f4a5be68",
        "a90280568a3132cb",
        "58b9b272b98d6be7",
    }
)

# By assessor the marks of code that answers alike: one joins where code was only arranged anew; a
# change of answers begins a new set, so that campaigns begun before it are told of it.
_ALIKE: dict[str, frozenset[str]] = {
    "gamma_quantile": _BEFORE_ROOMS
    | {
        "ea9a47cd4976503f",
        "8dfb42ad2f1fa880",
        "b1cf89dd11ffcffe",
        "92c21a4bb3ec2a38",
        "1f2b66209ee755c1",
        "bbaffb0b966dd2e9",
        "d5dd40b6cafee31e",
        "1d486d1c9f1a92c8",
        "24fb0bd491682aec",
        "10d052fde1b55234",
    },
    "invalidation_calibrated": _BEFORE_ROOMS
    | {
        "342f7d8eb92a4336",
        "2359c6c565f88431",
        "b295789925e904fc",
        "136d34131906ef05",
        "b607931e6f633d3a",
        "ae77007204b5a5d7",
        "2c5cc81baff430c1",
        "53eae1347946df32",
        "a9472d0cbe58c2e5",
        "da4d0b5547c19315",
    },
    "kinematic": _BEFORE_ROOMS
    | {
        "013c4e27f85dfbe6",
        "5d46601c6b4a848f",
        "ec5bc9a390f5ab84",
        "8e1bb6d080eeda6f",
        "e13db065367f0d1a",
        "a3a306a7af20befb",
        "24590e6c382d9ce2",
        "25a6c4c362d81319",
        "7e848690e904ccb6",
        "f3f21bec9da43ed7",
    },
    "model_invalidation_full": _BEFORE_ROOMS
    | {
        "9c378ac63b7a94d6",
        "ba028a354b6609f4",
        "f922bfe981ed1abf",
        "6c3f88d9087efb73",
        "ec7a1a87ea98390e",
        "5485300349a48fa1",
        "b7886dc5a7e43eb3",
        "78523a5a6a88645a",
        "96f58be867418b04",
        "92bfb6d205508f5d",
    },
    "region_share": _BEFORE_ROOMS
    | {
        "f78096dfad5397d1",
        "26e6f3ceebbbcf39",
        "02b91a8e49c3da8c",
        "9e5efc1a7d7755e5",
        "3985176744349931",
        "315c9ed2d8f5cf5b",
        "dc7f051aec6d76aa",
        "cf29ab329771140d",
        "4e3f0df198aa2d54",
        "61fbace2f1dd1d6f",
    },
    "single_shot": _BEFORE_ROOMS
    | {
        "79f6c4e7bcbed712",
        "9bc00b590c848797",
        "99bc95063c5154d9",
        "0fd8bee355f51b05",
        "b26433629f82dbdb",
        "368fe70b6419f77d",
        "c493ebfeef6e6e0e",
        "3d79144dae3e6db8",
        "fae3e4547cf3d882",
        "78e3f912c25b7d18",
    },
    "two_stage": _BEFORE_ROOMS
    | {
        "aa386e4d4cbe4d9c",
        "63218d533e28078f",
        "42c20fc02fe70a7a",
        "6de38d1bb0294859",
        "e9a469f2807caf7a",
        "e36479a8446a76f6",
        "4dfe50642c439a13",
        "1f0309015ec09ed6",
        "5d745eeb0d516549",
        "5f6765afb841d0cd",
    },
}


def assessor_code(assessor: AdaptiveAssessor) -> str:
    """Mark of the code that chooses an assessor's points and makes its bounds.

    It holds every statement of the modules of ``kinacc.assess`` that the assessor's own runs, and
    of the distributions: no import, comment or docstring and no module's name, so it stays where
    modules only move.
    """
    waiting, seen = {type(assessor).__module__}, set()
    statements: set[str] = set()
    while waiting:
        name = waiting.pop()
        seen.add(name)
        tree = ast.parse(provenance.source(name) or "")  # a name imported may be a function
        waiting |= {each for each in _imported(tree) if each.startswith(_ANSWERS)} - seen
        statements |= {_written(each) for each in _telling(tree.body)}
    return hashlib.sha256("\n".join(sorted(statements)).encode()).hexdigest()[:16]


def answers_alike(recorded: str | None, assessor: AdaptiveAssessor) -> bool:
    """Whether an assessor answers as it did when the mark ``recorded`` was made."""
    now = assessor_code(assessor)
    return recorded == now or {recorded, now} <= _ALIKE.get(assessor.name, frozenset())


def doubts(opened: Opened) -> list[str]:
    """What to know of a campaign as it was read: other code, a last line that was cut off.

    Other code may choose other points than were measured, and say other bounds of equal readings.
    """
    lines = []
    if not answers_alike(opened.plan.about.get("assessor_code"), opened.plan.assessor):
        begun = opened.plan.about.get("kinacc_version", "an earlier state")
        lines.append(f"begun with other code of the assessors, of kinacc {begun}")
    if opened.journal.cut_off:
        lines.append(
            "the last entry was cut off while it was written and never confirmed; it is left out: "
            "look whether the last reading has to be recorded again"
        )
    return lines


def marks_of(opened: Opened) -> dict[str, object]:
    """Provenance: the plan counts as the configuration, the journal as the input."""
    assessor = type(opened.plan.assessor).__module__
    return {
        "kinacc_version": __version__,
        "config_hash": opened.digest,
        "code_hash": provenance.code_hash(
            "kinacc.campaign.report", assessor, "kinacc.artifacts.store"
        ),
        "inputs_hash": opened.journal.last,
        "seed": opened.plan.seed,
        INPUTS_DIGESTS: as_text({"plan": opened.digest, "journal": opened.journal.last}),
    }


def _imported(tree: ast.AST) -> Iterator[str]:
    """Absolute names a module's source imports; `from a import b` gives a and a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))


def _telling(body: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """Statements that do something: no import and no text that stands alone."""
    for node in body:
        alone = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if not alone and not isinstance(node, (ast.Import, ast.ImportFrom)):
            yield node


def _written(node: object) -> str:
    """Source as text that is the same under every Python: without places and empty fields."""
    if isinstance(node, list):
        return f"[{','.join(map(_written, node))}]"
    if not isinstance(node, ast.AST):
        return repr(node)
    parts = []
    for name, value in ast.iter_fields(node):
        if name == "body" and isinstance(value, list):
            value = list(_telling(value))
        if value not in (None, []):
            parts.append(f"{name}={_written(value)}")
    return f"{type(node).__name__}({','.join(parts)})"
