"""What rows and tables of one data set must say of each other, beyond single columns.

A rule runs where all tables it needs are there and readable.
"""

from __future__ import annotations

from kinacc.errors import Problem
from kinacc.workflow.verification import assessment_rules, calibration_rules
from kinacc.workflow.verification.rule import Rule, Tables

RULES = (*calibration_rules.RULES, *assessment_rules.RULES)


def contradictions(tables: Tables) -> list[tuple[Problem, tuple[str, ...]]]:
    """Everything the tables of one data set say that cannot be, with the tables it may lie in."""
    return [
        (problem, needed)
        for needed, rule in RULES
        if all(name in tables and len(next(iter(tables[name].values()))) for name in needed)
        for problem in _told(rule, needed, tables)
    ]


def _told(rule: Rule, needed: tuple[str, ...], tables: Tables) -> list[Problem]:
    try:
        return list(rule(tables))
    except Exception as error:  # whatever values that nobody would write may lead to
        where = ", ".join(f"{name}.parquet" for name in needed)
        return [Problem(where, f"cannot be held to its rules: {type(error).__name__} {error}")]
