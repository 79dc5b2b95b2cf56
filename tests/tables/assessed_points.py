"""A table of points with errors, as tests of tables write it."""

import numpy as np


def points(joints=6, rows=12):
    draw = np.random.default_rng(3)
    angles = {f"q{joint + 1}": draw.uniform(size=rows) for joint in range(joints)}
    travel = {f"s{joint + 1}": np.arange(rows, dtype=np.int8) % 3 - 1 for joint in range(joints)}
    errors = {name: draw.uniform(size=rows) for name in ("ex_mm", "ey_mm", "ez_mm")}
    return {"point": np.arange(rows)} | angles | travel | errors | {"true_error_mm": np.ones(rows)}
