"""What the calibrations of many robots are worth: what ``kinacc summary`` says of each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from kinacc.assess.conformity import UNDECIDED
from kinacc.assess.statement import CANDIDATES, Statement
from kinacc.calibration.summary import Tolerance, facts_in, of
from kinacc.calibration.summary import tolerance as tolerance_in
from kinacc.campaign import journal, of_calibration, tolerance, words
from kinacc.campaign.of_calibration import Sought
from kinacc.config.error_models import model_name
from kinacc.deployment import folder as results
from kinacc.errors import InputError, Problem
from kinacc.tables import store, sums

FEW = 4  # data sets of which each is told of at the end of a run
BOUND, HELD_OUT = "bound", "held-out"
_TOLERANCE_OF = {BOUND: "bound", HELD_OUT: "quantile_99"}
_DAY = 10  # characters of a time


@dataclass(frozen=True)
class Verdict:
    """Whether an error is within a tolerance: ``accept``, ``reject`` or ``undecided``, and why.

    ``whose`` says where the tolerance stands; empty where it was asked for.
    """

    says: str
    because: str
    tolerance_mm: float
    whose: str = ""


@dataclass(frozen=True)
class Standing:
    """What is known of the calibration in the results folder of a data set.

    ``model`` is the error model that is selected, ``held_out`` its errors at poses that no fit has
    seen: ``n``, ``mean``, ``quantile_99`` and ``largest`` in mm, empty where none are held out.
    ``written``: day on which the file of its summary was written, by the file's time;
    ``tolerance``: that of its configuration. ``problem`` is why nothing is known; None where
    something is.
    """

    folder: Path
    robot: str | None = None
    model: str | None = None
    held_out: Mapping[str, float] = field(default_factory=dict)
    campaigns: Sought = field(default_factory=lambda: Sought(None))
    written: str | None = None
    tolerance: Tolerance | None = None
    problem: Problem | None = None

    @property
    def name(self) -> str:
        """Name of the data set."""
        return self.folder.resolve().name

    def bound(self) -> dict[str, object]:
        """The bound of its campaign, on what it is and if what; empty where there is none."""
        found = self.campaigns.assessed
        if found is None:
            return {}
        state, said = found.state, found.said or Statement(CANDIDATES)
        known = {
            "campaign": str(found.place),
            "campaign_date": found.recorded[:_DAY] or None,
            "readings": state.taken,
        }
        if math.isnan(said.upper_mm):
            return known
        about = state.plan.about
        model = model_name(str(about["model"]))
        return known | {
            "bound_mm": said.upper_mm,
            "lower_mm": said.lower_mm,
            "confidence": said.confidence,
            "bound_of": f"{words.about(said, state)}, {about['point']} by the {model} model",
            "bound_if": words.conditions(said, state),
        }

    def doubts(self) -> list[str]:
        """What has to be known beside the figures, a line each."""
        if self.problem is not None:
            return [str(self.problem)]
        found, lines = self.campaigns.assessed, list(self.campaigns.remarks)
        if found is None:
            return lines
        if found.said is None or math.isnan(found.said.upper_mm):
            why = words.reason(found.said.withheld) if found.said else None
            lines.append(f"no bound so far: {why or 'its campaign has not enough readings'}")
        lines += [*_against(self.campaigns), *words.begun_against(found.state.plan)]
        about = str(found.state.plan.about["model"])
        if about != self.model:
            lines.append(f"the bound is about {model_name(about)}, which is not the model selected")
        return lines

    def verdict(self, by: str, tolerance_mm: float | None) -> Verdict | None:
        """The verdict ``by`` the bound of its campaign, or by errors held out.

        Where no tolerance is given, the campaign's own counts, then that of the configuration
        where it is of the same; None where there is none.
        """
        found, whose = self.campaigns.assessed, ""
        if tolerance_mm is None and found is not None and by == BOUND:
            tolerance_mm, whose = found.state.plan.limits.tolerance_mm, tolerance.OF_CAMPAIGN
        if tolerance_mm is None and self.tolerance and self.tolerance.of == _TOLERANCE_OF[by]:
            tolerance_mm, whose = self.tolerance.mm, tolerance.OF_CONFIGURATION
        if tolerance_mm is None:
            return None
        says, because = UNDECIDED, ""
        if self.problem is not None:
            because = "there are no results to go by"
        elif by == HELD_OUT:
            of = Tolerance(tolerance_mm, _TOLERANCE_OF[by])
            says, because = tolerance.by_held_out(of, self.held_out)
        elif found is not None and found.said is None and not _against(self.campaigns):
            because = "its campaign says nothing yet"
        else:
            said = None if found is None else found.said
            says, because = tolerance.by_bound(tolerance_mm, said, bool(_against(self.campaigns)))
        return Verdict(says, because, tolerance_mm, whose)


def _against(campaigns: Sought) -> list[str]:
    found = campaigns.assessed
    said = [] if found is None or found.said is None else [found.said]
    return words.against(said, found.state) if found is not None else []


def data_sets(folders: Iterable[Path]) -> list[Path]:
    """Results folders of data sets among the ``folders`` and in them, in the order of their names.

    Campaigns are none. Raises InputError for each folder that holds nothing.
    """
    found: dict[Path, None] = {}
    problems = []
    for folder in folders:
        if not folder.is_dir():
            what = "is no folder" if folder.exists() else "no such folder"
            fix = "name the folder of all results, or of one data set"
            problems.append(Problem(str(folder), what, fix=fix))
            continue
        inside = [folder] if any(folder.glob("*.parquet")) else sorted(map(Path, folder.iterdir()))
        own = [each for each in inside if _may_be_one(each)]
        found |= dict.fromkeys(own)
        if not own:
            fix = "calibrate one: kinacc calibrate FILE.yaml"
            problems.append(Problem(str(folder), "holds no results", "results of data sets", fix))
    if problems:
        raise InputError(problems)
    return list(found)


def _may_be_one(folder: Path) -> bool:
    hidden = folder.name.startswith(".")
    return folder.is_dir() and not hidden and not (folder / journal.PLAN).is_file()


def standings(folders: Sequence[Path]) -> list[Standing]:
    """What is known of every data set's results, or what is wrong with them."""
    campaigns = journal.of_each(folders)
    found = []
    for folder in folders:
        try:
            found.append(_standing(folder, campaigns[folder]))
        except InputError as error:
            found.append(Standing(folder, problem=error.problems[0]))
    return found


def _standing(folder: Path, campaigns: Sequence[Path]) -> Standing:
    path = folder / "summary.parquet"
    if not path.is_file():
        fix = "kinacc calibrate FILE.yaml, with the file of this data set, makes one"
        raise InputError(Problem(str(folder), "holds no summary.parquet", fix=fix))
    robot, model, held_out, tolerance = _told(path)
    if path.name in sums.outdated(folder):
        what = "was made from other tables than those now beside it"
        raise InputError(Problem(str(path), what, fix=store.remake(path)))
    tables = results.read_tables(folder, "robot") if campaigns else {}
    sought = of_calibration.sought(folder.resolve().name, tables, campaigns)
    written = datetime.fromtimestamp(path.stat().st_mtime, UTC).date().isoformat()
    return Standing(folder, robot, model, held_out, sought, written, tolerance)


def _told(path: Path) -> tuple[str, str, dict[str, float], Tolerance | None]:
    """Of a summary the robot, the model selected, its errors held out, and the tolerance."""
    try:
        facts = facts_in(store.read(path))
        (robot,) = [str(each.text) for each in facts if each[:3:2] == ("robot", "name")]
        chosen = of(facts, "selection").items()
        (model,) = [item for item, known in chosen if known["selected"].value]
        held_out = of(facts, "held_out_error").get(model, {})
        known = {name: float(each.value) for name, each in held_out.items()}
        return robot, model, known, tolerance_in(facts)
    except (LookupError, TypeError, ValueError):
        what = "does not say which robot it is about, or which model is selected"
        raise InputError(Problem(str(path), what, fix=store.remake(path))) from None
