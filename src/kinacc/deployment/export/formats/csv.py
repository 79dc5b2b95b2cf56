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
    dh, left_open = source.dh, source.calibration.left_open or ()
    names = [name.replace("_rad", "_deg") for name in PARAMETERS]
    stds, nominals = ([f"{which}_{name}" for name in names] for which in ("std", "nominal"))
    factor = np.array([180.0 / np.pi if name.endswith("_rad") else 1.0 for name in PARAMETERS])
    fitted, nominal = (
        np.stack([getattr(model, name) for name in PARAMETERS], axis=1)
        for model in (dh, source.calibration.robot.dh)
    )
    values = np.concatenate([part * factor for part in (fitted, source.std, nominal)], axis=1)
    texts: list[list[str]] = [[] for _ in range(dh.joints)]
    for sentence in left_open:
        for joint in {*map(int, re.findall(r"joint (\d+)", sentence))} or {dh.joints}:
            texts[joint - 1].append(sentence)
    texts[-1] += source.orientation_lines
    note = in_csv(in_words([source.misfit]))
    rows: list[list[object]] = [
        ["joint", "type", *names, *stds, *nominals, "undetermined", "std_note"]
    ]
    for joint, (numbers, about) in enumerate(zip(values, texts, strict=True)):
        cells = ("" if np.isnan(x) else f"{x:.12g}" for x in numbers)
        rows.append([joint + 1, kind(dh, joint), *cells, in_csv("; ".join(about)), note])
    return csv_text(rows)
