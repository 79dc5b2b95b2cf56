"""Shared test setup: oracles importable from every folder, property tests repeatable."""

from __future__ import annotations

import signal
import sys
from functools import cache
from pathlib import Path

import pytest
from hypothesis import settings

# What a shell starts in the background has Ctrl-C ignored, and so has all that it starts.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Works in every pytest import mode, from tests/ and from any folder below it.
TESTS = Path(__file__).resolve().parent
sys.path[:0] = [str(TESTS), str(TESTS.parent / "tools")]
sys.path.append(str(TESTS.parent / "benchmarks"))

# Files and folders left out of `make check`; measured with `pytest --durations=0`. The first ones
# take longest: `make test` hands them out first, so that no worker is left alone with one.
SLOW = (
    "integration/test_installed.py",
    "integration/test_real_arm.py",
    "integration",
    "slurm",
    "workflow/test_pipeline.py",
    "gate/test_check_results.py",
    "integration_oracle",
    "measurements/test_files_as_they_come.py",
    "checks/test_planted_faults.py",
    "benchmarks",
    "calibration/test_chosen_order.py",
    "calibration/test_dh_fit.py",
    "calibration/test_oracle_fits.py",
    "calibration/test_reach.py",
    "calibration/test_repeated_configurations.py",
    "calibration/test_vec_fit.py",
    "campaign/test_campaign_commands.py",
    "campaign/test_growing_file.py",
    "campaign/test_lost_readings.py",
    "campaign/test_on_a_real_arm.py",
    "campaign/test_planning.py",
    "campaign/test_state.py",
    "checks/test_check_data.py",
    "cli/test_init.py",
    "cli/test_init_readings.py",
    "cli/test_init_robots.py",
    "cli/test_rows_as_the_user_calls_them.py",
    "cli/test_the_same_readings_compared.py",
    "deployment/test_applicability.py",
    "deployment/test_compare.py",
    "deployment/test_verify.py",
    "deployment/test_compensate.py",
    "deployment/test_history.py",
    "deployment/test_predict.py",
    "figures/test_figure_files.py",
    "figures/test_figures.py",
    "kinematics/inverse/test_any_arm.py",
    "measurements/test_what_files_hold.py",
    "report/test_in_a_browser.py",
    "report/test_calibration_summary.py",
    "research",
    "study/test_accuracy_map_oracle.py",
    "test_hostile_files.py",
    "test_inverse_oracle.py",
    "test_models_oracle.py",
    "test_strangers_names.py",
    "test_strangers_text.py",
    "study/test_study_oracle.py",
    "workflow/test_calibration_stages.py",
    "workflow/test_robustness.py",
)
_SLOW = tuple(TESTS / name for name in SLOW)
# For a night (`make test-all`): runs on a cluster, pages in a browser, research, the site, and the
# whole measured series, whose stages are golden by themselves.
NIGHT = tuple(
    TESTS / name
    for name in (
        "benchmarks",
        "integration/test_real_arm.py",
        "integration/test_site.py",
        "report/test_in_a_browser.py",
        "research",
        "slurm",
    )
)

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.register_profile("night", settings.get_profile("repeatable"), max_examples=1000)
settings.load_profile("repeatable")


@cache
def place(path: Path) -> int:
    """Index in ``SLOW`` of what holds a file; the length of ``SLOW`` where it is quick."""
    held = (number for number, slow in enumerate(_SLOW) if path.is_relative_to(slow))
    return next(held, len(SLOW))


def pytest_ignore_collect(collection_path, config):
    """Do not even read files whose tests are left out."""
    quick = config.option.markexpr == "not slow and not night"
    if quick and place(collection_path) < len(SLOW):
        return True
    if "not night" in config.option.markexpr and any(map(collection_path.is_relative_to, NIGHT)):
        return True
    return None


def pytest_collection_modifyitems(items):
    """Mark the tests of slow files and of the night; longest first."""
    for item in items:
        if place(item.path) < len(SLOW):
            item.add_marker(pytest.mark.slow)
        if any(map(item.path.is_relative_to, NIGHT)):
            item.add_marker(pytest.mark.night)
    items.sort(key=lambda item: place(item.path))


def pytest_terminal_summary(terminalreporter):
    """Say how many tests were skipped because measured data, a browser or Slurm is absent."""
    import shared_data

    reasons = [str(report.longrepr) for report in terminalreporter.stats.get("skipped", ())]
    absent = sum(shared_data.ABSENT in reason for reason in reasons)
    if absent:
        line = f"{absent} skipped: the measured data sets are expected in {shared_data.FOLDER}"
        terminalreporter.write_line(line, yellow=True)
    if any("Slurm absent" in reason for reason in reasons):
        line = "runs on a cluster are tested as root with Debian's slurm-wlm and .venv/cluster"
        terminalreporter.write_line(line, yellow=True)
    unseen = sum("Chromium absent" in reason for reason in reasons)
    if unseen:
        line = f"{unseen} skipped: pages are looked at in Debian's chromium and chromium-driver"
        terminalreporter.write_line(line, yellow=True)
