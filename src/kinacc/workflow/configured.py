"""What a plan takes of the configuration: values from the command line read, unused ones left out.

Importing it costs nothing but the standard library.
"""

from __future__ import annotations

from collections.abc import Mapping

from kinacc.config.error_models import ERROR_MODELS, asked_for
from kinacc.errors import InputError

# Keys of files that tables of results do not know of where they are at their defaults.
_LEFT_OUT_AS_USUAL = (
    *("exclude", "thousands", "encoding", "sheet", "layout", "directions", "no_reading", "sigma"),
    *("names", "pulses_per_deg", "repeats_in_names"),
)


def words_read(values: object) -> object:
    """Texts read as YAML: Snakemake hands numbers inside ``--config a='{b: 1}'`` over as text."""
    import yaml

    if isinstance(values, Mapping):
        return {key: words_read(value) for key, value in values.items()}
    if isinstance(values, (list, tuple)):
        return [words_read(value) for value in values]
    if not isinstance(values, str):
        return values
    from kinacc.config.load import COMMAND_LINE
    from kinacc.config.reading import unreadable

    problem = unreadable(values, COMMAND_LINE)
    if problem:
        raise InputError(problem)
    return yaml.safe_load(values)


def in_use(config: dict) -> dict:
    """The configuration without what it does not use.

    That is the other source of measurements, models nobody asks for, a tolerance that is not set,
    and keys of files that are as usual and came later than tables of results.
    """
    unused = {"synthetic", "file"} - {config["measurements"]["source"]}
    measurements = {k: v for k, v in config["measurements"].items() if k not in unused}
    if "file" in measurements:
        from kinacc.config.schema import defaults

        usual = defaults()["measurements"]["file"]
        file = {
            key: value
            for key, value in measurements["file"].items()
            if key not in _LEFT_OUT_AS_USUAL or value != usual[key]
            if key != "joints" or value["path"]
        }
        measurements = {**measurements, "file": file}
    calibration, asked = config["calibration"], asked_for(config["calibration"])
    calibration = {
        name: section
        for name, section in calibration.items()
        if name in asked or name not in ERROR_MODELS
    }
    used = {**config, "measurements": measurements, "calibration": calibration}
    if config["tolerance"]["mm"] is None:
        del used["tolerance"]
    return used
