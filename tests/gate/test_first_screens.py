"""What the gate hands on of every report: without a browser, a picture, or a table that is not."""

from __future__ import annotations

import subprocess
import sys

from kinacc.gate.first_screens import first_screens


def test_results_that_hold_no_calibration_say_so_and_stop_nothing(tmp_path):
    (tmp_path / "cell").mkdir()
    (tmp_path / "press").mkdir()
    (tmp_path / "press" / "measurements.parquet").write_text("no table")
    told = first_screens(tmp_path, ["cell", "press"])
    assert {*told} == {"cell", "press"}
    for text in told.values():
        assert text.startswith("not told: ")
        assert "model_selection.parquet: no such file; run the workflow first" in text


def test_a_gate_does_not_wait_for_libraries_that_draw():
    heavy = "'bokeh', 'matplotlib', 'pandas', 'snakemake', 'scipy.stats', 'numba', 'jinja2'"
    code = (
        "import sys, kinacc.gate.first_screens, kinacc.gate.outputs\n"
        f"print(*{{{heavy}}} & {{*sys.modules}})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
