"""Errors at held-out rows, straight from the tables of a results folder."""

from pathlib import Path

import numpy as np
import pandas as pd


def held_out_mm(folder: Path) -> np.ndarray:
    """Position errors (n, 3) of the selected model."""
    errors, chosen = (pd.read_parquet(folder / f"{name}.parquet")
                      for name in ("pose_errors", "model_selection"))  # fmt: skip
    model = chosen.query("selected == 1")["model"].item()
    own = f"estimate == 'cross_validated' and comparison == '{model}_vs_measured'"
    return errors.query(own)[["ex_mm", "ey_mm", "ez_mm"]].to_numpy()
