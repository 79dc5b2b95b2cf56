"""One row per joint: fitted values, their standard deviations and the nominal values."""

from __future__ import annotations

import re

import numpy as np

from kinacc.calibration.misfit import in_words
from kinacc.config.names import csv_text, in_csv
from kinacc.deployment.export.source import Source, kind
from kinacc.kinematics.dh import PARAMETERS

ENDING, ANY_MODEL = ".csv", False


def text(source: Source) -> str:
    """The file, in degrees and mm, with what the poses leave open of a joint.

    What is of no joint, as of base and tool, stands in the row of the last one.
    """
    dh, told = source.dh, source.calibration.left_open or ()
    names = [name.replace("_rad", "_deg") for name in PARAMETERS]
    stds, nominals = ([f"{which}_{name}" for name in names] for which in ("std", "nominal"))
    factor = np.array([180.0 / np.pi if name.endswith("_rad") else 1.0 for name in PARAMETERS])
    fitted, given = (
        np.stack([getattr(model, name) for name in PARAMETERS], axis=1) * factor
        for model in (dh, source.calibration.robot.dh)
    )
    values = np.concatenate([fitted, source.std * factor, given], axis=1)
    joints_of = [set(map(int, re.findall(r"joint (\d+)", text))) for text in told]
    note = in_csv(in_words([source.misfit]))
    rows: list[list[object]] = [
        ["joint", "type", *names, *stds, *nominals, "undetermined", "std_note"]
    ]
    for joint in range(1, dh.joints + 1):
        is_last = joint == dh.joints
        pairs = zip(told, joints_of, strict=True)
        own = [each for each, joints in pairs if joint in joints or (is_last and not joints)]
        own += source.orientation_lines if is_last else []
        numbers = ("" if np.isnan(x) else f"{x:.12g}" for x in values[joint - 1])
        rows.append([joint, kind(dh, joint - 1), *numbers, in_csv("; ".join(own)), note])
    return csv_text(rows)
