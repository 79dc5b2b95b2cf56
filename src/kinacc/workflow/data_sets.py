"""The data sets of a configuration as the rules see them: settings, models, files from outside."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinacc.config.error_models import ERROR_MODELS, asked_for
from kinacc.config.records import Settings
from kinacc.errors import Problem, refuse
from kinacc.tables import sums

RESULTS = "results"
# What a calibration depends on, and what the rule `summary` hands to its script.
CALIBRATION = ("seed", "robot", "measurements", "calibration", "tolerance")


@dataclass(frozen=True)
class DataSets:
    """Settings of every data set by name, complete and without what it does not use.

    ``parts`` is the number of parts of scattered work, ``formats`` those of pictures.
    ``absolute`` names files from outside in full, as a module of another workflow needs them.
    """

    settings: Mapping[str, Settings]
    parts: int
    formats: tuple[str, ...]
    absolute: bool = False

    def chosen(self, dataset: str, *paths: str) -> dict[str, Any]:
        """Settings of a data set at dotted paths, nested as in the configuration."""
        selected: dict[str, Any] = {}
        for path in paths:
            *sections, key = path.split(".")
            source: Any = self.settings[dataset]
            target = selected
            if (sections or [key])[0] not in source:
                continue  # not in use
            for section in sections:
                source, target = source[section], target.setdefault(section, {})
            if key in source:
                target[key] = source[key]
        return selected

    def models(self, dataset: str) -> tuple[str, ...]:
        """Error models that a data set asks for, in the order they are fitted."""
        return asked_for(self.settings[dataset]["calibration"])

    def is_measured(self, dataset: str) -> bool:
        """Whether the poses of a data set stand in a file."""
        return self.settings[dataset]["measurements"]["source"] == "file"

    def has_map(self, dataset: str) -> bool:
        """Whether the evaluation space of a data set is a cylinder, which can be mapped."""
        return self.settings[dataset]["evaluation"]["space"] == "cylinder"

    def lines(self, dataset: str) -> list[str]:
        """Data sets of the lines of a series by date; none where there is no series."""
        return [line["name"] for line in self.settings[dataset].get("series", ())]

    @property
    def reported(self) -> list[str]:
        """Data sets that have a whole study: all but lines of a series, which are calibrated."""
        return [name for name, settings in self.settings.items() if "line_of" not in settings]

    def robot_files(self, dataset: str) -> dict[str, str]:
        """A robot file of the user's own, and its URDF, by role."""
        robot = self.settings[dataset]["robot"]
        if not os.path.isfile(robot):
            return {}
        from kinacc.kinematics.robot import files

        return self._located(dict(zip(("robot_file", "urdf_file"), files(robot), strict=False)))

    def measured_files(self, dataset: str) -> dict[str, str]:
        """Files with the measurements of a data set, by role."""
        if not self.is_measured(dataset):
            return {}
        file = self.settings[dataset]["measurements"]["file"]
        files = {"points_file": file["path"], "joints_file": file["joints"]["path"]}
        return self._located({role: path for role, path in files.items() if path})

    def _located(self, files: Mapping[str, object]) -> dict[str, str]:
        place = os.path.abspath if self.absolute else str
        return {role: place(str(path)) for role, path in files.items()}


def read_data_sets(
    paths: Sequence[str | os.PathLike[str]],
    overrides: Settings | None = None,
    absolute: bool = False,
) -> DataSets:
    """The data sets of configuration files and of values of the command line.

    Parameters
    ----------
    paths
        YAML files, in order.
    overrides
        Values of ``--config``, laid over them.
    absolute
        Whether files are named by absolute paths.

    Returns
    -------
    DataSets
        Settings by data set, and files.

    Raises
    ------
    InputError
        Listing every problem in them.
    """
    from kinacc.checks.configuration import COMMAND_LINE, load

    source = "config of the module" if absolute else COMMAND_LINE
    overrides = _values(overrides or {}, source)
    full = load([Path(path) for path in paths], overrides, source=source)
    return data_sets(full, absolute)


def data_sets(full: Mapping[str, Mapping[str, Any]], absolute: bool = False) -> DataSets:
    """The data sets of full settings by name. Raises InputError listing every problem in them."""
    from kinacc.config.schema import without_execution_keys

    first = next(iter(full.values()))
    problems = [
        Problem(f"datasets.{name}.figures.formats", "differ from data set to data set", "one list")
        for name, config in full.items()
        if config["figures"]["formats"] != first["figures"]["formats"]
    ]
    refuse(problems)
    plan = DataSets(
        {name: _in_use(without_execution_keys(config)) for name, config in full.items()},
        min(first["study"]["chunks"], *(item["study"]["repetitions"] for item in full.values())),
        tuple(first["figures"]["formats"]),
        absolute,
    )
    refuse(
        Problem(path, "braces in its name would be a wildcard of Snakemake", fix="rename it")
        for name in plan.settings
        for path in (*plan.measured_files(name).values(), *plan.robot_files(name).values())
        if re.search(r"\{\s*\w.*\}", path)
    )
    return plan


def _values(value: Any, source: str) -> Any:
    """Texts read as YAML: Snakemake hands numbers inside ``--config a='{b: 1}'`` over as text."""
    from kinacc.config.reading import parsed

    if isinstance(value, Mapping):
        return {key: _values(item, source) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_values(item, source) for item in value]
    return parsed(value, source).data if isinstance(value, str) else value


def _in_use(config: Settings) -> dict[str, Any]:
    """The settings without the other source of measurements and models that nobody asks for."""
    unused = {"synthetic", "file"} - {config["measurements"]["source"]}
    unused |= {*ERROR_MODELS} - {*asked_for(config["calibration"])}
    sections = {
        section: {key: value for key, value in config[section].items() if key not in unused}
        for section in ("measurements", "calibration")
    }
    return {**config, **sections}


def digests(files: Mapping[str, str]) -> dict[str, str]:
    """Digests of files by role, by which a rule knows their content and not their dates."""
    return {role: sums.digest(Path(path).read_bytes()) for role, path in files.items()}


def campaign_files(campaigns: Iterable[Path]) -> dict[str, str]:
    """Files of campaigns on the calibration of a data set, by role."""
    from kinacc.campaign.beside_results import JOURNAL, PLAN

    files = {}
    for number, campaign in enumerate(campaigns, 1):
        files[f"campaign_{number}_file"] = str(campaign / PLAN)
        if (campaign / JOURNAL).is_file():
            files[f"readings_{number}_file"] = str(campaign / JOURNAL)
    return files
