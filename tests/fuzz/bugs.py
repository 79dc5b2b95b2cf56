"""Faults of the past, put back one at a time, to see whether the fuzzer finds them again.

Each is a piece of the source as it is now and as it was before the commit that mended it; the
module is loaded with it, and nothing on disk changes. ``run.py --bugs`` looks for all of them.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType

PACKAGE = "kinacc"


@dataclass(frozen=True)
class Bug:
    """``now`` in a module becomes ``was``; ``targets`` read through it; ``commit`` mended it."""

    module: str
    now: str
    was: str
    targets: tuple[str, ...]
    commit: str


_TEXT = ("described text or workbook", "measured file")
BUGS: dict[str, Bug] = {
    "huge whole numbers in a configuration": Bug(
        "kinacc.config.values",
        "if not abs(value) < _LARGEST:",
        "if not __import__('math').isfinite(value):",
        ("configuration",),
        "560def0",
    ),
    "huge whole numbers in cells": Bug(
        "kinacc.measurements.table",
        """        return _number(cell, decimal, thousands)
    except (OverflowError, TypeError, ValueError):""",
        """        return _number(cell, decimal, thousands)
    except (TypeError, ValueError):""",
        ("described workbook", "described Parquet", "joints"),
        "560def0",
    ),
    "dates outside the calendar in Parquet": Bug(
        "kinacc.measurements.parquet_file",
        "    except (pa.ArrowException, ArithmeticError, LookupError, ValueError):",
        "    except pa.ArrowException:",
        ("described Parquet",),
        "560def0",
    ),
    "damaged Parquet files": Bug(
        "kinacc.measurements.parquet_file",
        "    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:",
        "    except pa.ArrowNotImplementedError as error:",
        ("described Parquet",),
        "560def0",
    ),
    "a column twice in a Parquet file": Bug(
        "kinacc.measurements.parquet_file",
        "if doubled and not problem:",
        "if False:",
        ("described Parquet",),
        "560def0",
    ),
    "a line of units that does not fit the names": Bug(
        "kinacc.measurements.intake.guess",
        "if len(units) != len(table.columns):",
        "if False:",
        ("measured file",),
        "94eebc4",
    ),
    "a cell without end": Bug(
        "kinacc.measurements.grid",
        "    except csv.Error as error:",
        "    except ZeroDivisionError as error:",
        _TEXT,
        "560def0",
    ),
    "a number of thousands of digits in a name": Bug(
        "kinacc.measurements.joining",
        r're.compile(r"(?<!\d)\d{1,100}(?!\d)")',
        r're.compile(r"\d+")',
        ("measured file",),
        "57a210f",
    ),
    "a column of results that is not there": Bug(
        "kinacc.deployment.folder",
        "    def __missing__(self, name: str)",
        "    def missing(self, name: str)",
        ("results used",),
        "148b454",
    ),
    "tags that do not fit in YAML": Bug(
        "kinacc.config.reading",
        "    except (ArithmeticError, AttributeError, LookupError, ValueError):",
        "    except (yaml.YAMLError, ValueError):",
        ("configuration", "robot"),
        "560def0",
    ),
    "nesting without end in YAML": Bug(
        "kinacc.config.reading",
        "            if depth > _DEEPEST:\n                what, allowed",
        "            if False:\n                what, allowed",
        ("configuration", "robot"),
        "560def0",
    ),
    "aliases of aliases in YAML": Bug(
        "kinacc.config.reading",
        "self.left -= 1",
        "self.left -= 0",
        ("configuration", "robot"),
        "560def0",
    ),
    "names no file can have": Bug(
        "kinacc.kinematics.robot.description",
        "    return [path, *(file for file in named if os.path.isfile(file))]",
        "    return [path, *(file for file in named if file.is_file())]",
        ("robot",),
        "560def0",
    ),
    "robots no file can have in a configuration": Bug(
        "kinacc.config.validate",
        "os.path.isfile(",
        "(lambda path: __import__('pathlib').Path(path).is_file())(",
        ("configuration",),
        "560def0",
    ),
    "a journal nested without end": Bug(
        "kinacc.campaign.journal",
        "        except (ValueError, KeyError, TypeError, RecursionError):",
        "        except (ValueError, KeyError, TypeError):",
        ("campaign",),
        "6eec24f",
    ),
    "a plan of no assessor": Bug(
        "kinacc.campaign.plan",
        "        ArithmeticError,\n        AttributeError,\n",
        "",
        ("campaign",),
        "6eec24f",
    ),
    "a plan that does not hold together": Bug(
        "kinacc.campaign.plan",
        "        return _checked(_plan(content))",
        "        return _plan(content)",
        ("campaign",),
        "6eec24f",
    ),
    "metadata of a table that are no text": Bug(
        "kinacc.artifacts.store",
        'return {key.decode(errors="replace"): raw[key].decode(errors="replace") for key in raw}',
        "return {key.decode(): raw[key].decode() for key in raw}",
        ("table",),
        "6eec24f",
    ),
    "words of a table that are no text": Bug(
        "kinacc.artifacts.store",
        "    except (OverflowError, ValueError) as error:",
        "    except ZeroDivisionError as error:",
        ("table",),
        "6eec24f",
    ),
    "a unit of a column that is no text": Bug(
        "kinacc.cli.rows",
        '.decode(errors="replace")',
        ".decode()",
        ("poses", "joints"),
        "148b454",
    ),
    "an entry that no command writes": Bug(
        "kinacc.campaign.folder",
        "state.require_readable(",
        "(lambda *words: None)(",
        ("campaign",),
        "379443d",
    ),
    "a column name that is an accent alone": Bug(
        "kinacc.measurements.column_names",
        "if not word:",
        "if False:",
        ("measured file",),
        "4b9064a",
    ),
    "an answer in JSON that holds no rows": Bug(
        "kinacc.cli.rows",
        "    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError):",
        "    except (ValueError, KeyError):",
        ("poses", "joints"),
        "d58e3cb",
    ),
}


class _Finder(importlib.abc.MetaPathFinder):
    """Loads one module of the package with a piece of its source as it was."""

    def __init__(self, bug: Bug) -> None:
        self.bug = bug

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """The module's own place, with a loader that changes its source."""
        if name != self.bug.module:
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        loader = spec.loader
        source = changed(self.bug, loader.get_source(name))

        class Loader(importlib.machinery.SourceFileLoader):
            def get_code(self, fullname: str) -> object:
                return compile(source, self.path, "exec")

        spec.loader = Loader(name, loader.path)
        return spec


def changed(bug: Bug, source: str) -> str:
    """A module's source with a bug put back; ValueError where the piece is not there as it is."""
    if bug.now not in source:
        raise ValueError(f"{bug.module} does not hold: {bug.now}")
    return source.replace(bug.now, bug.was)


def put_back(name: str) -> None:
    """Let modules that are imported from now on have a bug."""
    bug = BUGS[name]
    assert bug.module not in sys.modules, bug.module
    sys.meta_path.insert(0, _Finder(bug))


def hunt(inputs: int, seed: int, names: Sequence[str] = ()) -> int:
    """Look for each bug among some inputs of its targets; 0 where 18 of 20 are found."""
    from fuzz.run import FINDINGS, outcomes

    found = 0
    for name in names or BUGS:
        bug = BUGS[name]
        work = [[each, seed, 0, inputs // len(bug.targets)] for each in bug.targets]
        said = "not found"
        looked = 0
        for _, each in outcomes(work, bug=name):
            looked += 1
            if each["outcome"] in FINDINGS:
                found += 1
                said = f"found: {each['outcome']} {each['where']}"[:90]
                break
        print(f"{name:45s} {bug.commit} {looked:6d} inputs  {said}", flush=True)
    total = len(names or BUGS)
    print(f"{found} of {total} found again")
    return 0 if found >= 0.9 * total else 1
