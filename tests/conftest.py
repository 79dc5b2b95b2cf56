"""Shared test setup: oracles importable from every folder, property tests repeatable."""

from __future__ import annotations

import gc
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

# Files and folders left out of `make check`, which take two seconds of a processor or more, longest
# first: `make test` hands them out in this order, so that no worker is left alone with a long one.
SLOW = (
    "integration/test_data_that_cannot_be_fitted.py",  # makes the run that others share
    "golden",
    "checks/test_planted_faults.py",
    "measurements/test_fuzzed_files.py",
    "measurements/test_files_as_they_come.py",
    "integration",
    "workflow/test_pipeline.py",
    "kinematics/inverse/test_any_arm.py",
    "test_hostile_files.py",
    "assess/test_every_assessor.py",
    "integration_oracle",
    "cli/test_outdated_results.py",
    "deployment/test_controllers.py",
    "test_notebooks.py",
    "checks/test_facts_of_a_file.py",
    "gate",
    "deployment/test_verify.py",
    "cli/test_init.py",
    "figures/test_figure_files.py",
    "figures/test_figures.py",
    "deployment/test_compare.py",
    "cli/test_snapshots.py",
    "cli/test_rows_as_the_user_calls_them.py",
    "calibration/test_few_poses.py",
    "assess/test_wrong_readings.py",
    "cli/test_init_robots.py",
    "cli/test_repeatability.py",
    "workflow/test_robustness.py",
    "assess/test_paper_assessors.py",
    "test_hostile_input.py",
    "report/test_calibration_summary.py",
    "deployment/test_history.py",
    "cli/test_init_readings.py",
    "campaign/test_campaign_commands.py",
    "checks/test_check_data.py",
    "deployment/test_predict.py",
    "workflow/test_calibration_stages.py",
    "cli/test_the_same_readings_compared.py",
    "assess/test_looks.py",
    "assess/test_noise_of_readings.py",
    "assess/test_search_and_confirm.py",
    "assess/test_limits.py",
    "campaign/test_consistency.py",
    "calibration/test_own_model.py",
    "calibration/test_repeated_configurations.py",
    "calibration/test_chosen_order.py",
    "study/test_study_oracle.py",
)
_SLOW = tuple(f"{TESTS / name}" for name in SLOW)
# For a night (`make test-all`): runs on a cluster, pages in a browser, research, the site, and the
# whole measured series, whose stages are golden by themselves.
NIGHT = tuple(
    f"{TESTS / name}"
    for name in (
        "benchmarks",
        "calibration/test_reach.py",
        "integration/test_site.py",
        "report/test_in_a_browser.py",
        "research",
        "slurm",
    )
)


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """Results folder of a small synthetic study, made once; left as it was by every test."""
    from command_line import small_study  # imports all of kinacc
    from shared_work import once

    folder = once(tmp_path_factory, "small study", small_study)
    return folder / "results" / "mh180"


settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.register_profile("night", settings.get_profile("repeatable"), max_examples=1000)
settings.load_profile("repeatable")


@cache
def place(path: Path) -> int:
    """Index in ``SLOW`` of what holds a file, its length for a quick one; -1 for the night's."""
    holders = {str(path), *map(str, path.parents)}
    if not holders.isdisjoint(NIGHT):
        return -1
    held = (number for number, slow in enumerate(_SLOW) if slow in holders)
    return next(held, len(SLOW))


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect no garbage among what is imported, now or in a test: it takes a third of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_ignore_collect(collection_path, config):
    """Do not even read files whose tests are left out."""
    number, asked = place(collection_path), config.option.markexpr
    left_out = (number < 0 and "not night" in asked) or (number < len(SLOW) and "not slow" in asked)
    return left_out or None


def pytest_collection_modifyitems(items):
    """Mark the tests of slow files and of the night; longest first."""
    for item in items:
        if place(item.path) < 0:
            item.add_marker(pytest.mark.night)
        elif place(item.path) < len(SLOW):
            item.add_marker(pytest.mark.slow)
    items.sort(key=lambda item: place(item.path))
