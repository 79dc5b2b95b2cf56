#!/usr/bin/env python3
"""Make the golden results anew: python tools/renew_golden.py [CASE ..]

CASE is a data set, faults, exports or campaign; all without one. Prints what differs from
before.
"""

import json
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "golden"))

import cases

from kinacc.deployment.export.files import contents
from kinacc.deployment.export.source import read_source
from kinacc.tables.comparison import compare_folders


def renew_inputs() -> None:
    """Measured files that results are made of."""
    cases.write_simulated_files()
    grid = pd.read_csv(cases.ROOT / "examples/data/ur5_gts/published_grid.csv")
    seen = {f"{axis}_mm": grid[f"{axis}_t"] + grid[f"{axis}_dif"] for axis in "xyz"}
    joints = {f"q{i}_deg": grid[f"joint_{i}"] for i in range(1, 7)}
    own = pd.DataFrame({**joints, **seen}).iloc[::2]  # 500 poses, for time
    own.to_csv(cases.GOLDEN / "data" / "ur5_grid.csv", index=False)


def renew_data_set(name: str) -> None:
    """Tables of a data set, each stage on those before it."""
    data, folder = cases.data_sets(), cases.RESULTS / name
    with tempfile.TemporaryDirectory() as kept:
        before = Path(kept) / name
        if folder.is_dir():
            shutil.copytree(folder, before)
            shutil.rmtree(folder)
        for stage in cases.DATA_SETS[name]:
            made = cases.run_stage(data, name, stage, folder)
            cases.write_tables(made, folder)
        if before.is_dir():
            print("\n".join(map(str, compare_folders(before, folder))) or f"{name}: no difference")


def renew_faults() -> None:
    """Files with planted faults and what check-data finds."""
    folder = cases.GOLDEN / "faults"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    found = {}
    for name, file in cases.faults():
        path = file.write(folder, name)
        path.write_text(path.read_text().replace(f"{folder}/", ""))
        found[name] = cases.findings(folder, name)
    _write(cases.GOLDEN / "faults" / "findings.json", found)


def renew_exports() -> None:
    """Exports of the UR10: the DH model in all formats, the VEC model as JSON."""
    folder = cases.GOLDEN / "exports"
    folder.mkdir(exist_ok=True)
    for model, formats in (("dh", ("yaml", "json", "csv", "urdf")), ("vec", ("json",))):
        made = contents(read_source(cases.RESULTS / "ur10_d", model), formats)
        for name, text in made.items():
            (folder / name).write_text(text)


def renew_campaign() -> None:
    """What a campaign makes of its journal, which stays as it was recorded."""
    _write(cases.GOLDEN / "campaign" / "course.json", cases.campaign_course())


def _write(path: Path, found: object) -> None:
    text = json.dumps(found, indent=1, default=_plain) + "\n"
    if path.is_file() and path.read_text() != text:
        print(f"{path.name} differs from before: git diff shows where")
    path.write_text(text)


def _plain(value: object) -> object:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else str(value)


if __name__ == "__main__":
    wanted = sys.argv[1:] or [*cases.DATA_SETS, "faults", "exports", "campaign"]
    renew_inputs()
    others = {
        "faults": renew_faults,
        "exports": renew_exports,
        "campaign": renew_campaign,
    }
    for case in wanted:
        others.get(case, lambda case=case: renew_data_set(case))()
