"""The page on public robots: what it says is in its table, and the table is what kinacc finds."""

from __future__ import annotations

import numpy as np
import public_robots as runs
import pytest


def test_the_page_is_written_from_its_table():
    written = (runs.DOCS / "public-robots.md").read_text(encoding="utf-8")
    assert written == runs.text(runs.read()), "run python tools/public_robots.py page"


@pytest.mark.parametrize(("fitted", "judged"), [("ur10_b", "ur10_d"), ("ur10_d", "ur10_b")])
def test_base_and_tool_fitted_elsewhere_are_judged_as_those_of_a_run_are(fitted, judged):
    """Of the nominal arm nothing but base and tool is fitted: to all readings, or all but a fifth.

    Twelve numbers take hardly anything off hundreds of readings.
    """
    nominal = runs.read().query("model == 'nominal' and where == 'all' and judged == @judged")
    errors = nominal.set_index("fitted")[["readings", "mean_mm", "rms_mm"]]
    seen, held_out = errors.loc[fitted], errors.loc[judged]
    assert seen["readings"] == held_out["readings"]
    assert np.all((seen[1:] < held_out[1:]) & (seen[1:] > 0.99 * held_out[1:]))
