"""A fit in a process of the user's own: how many BLAS threads it takes, and what it leaves."""

from __future__ import annotations

from threading import Event, Thread

import numpy as np
import pytest
import scipy.linalg  # noqa: F401 (its BLAS is one of those counted)
import simulated
from threadpoolctl import threadpool_info, threadpool_limits

from kinacc.calibration import fitting, vec_fit
from kinacc.calibration.constraints import free_parameters
from kinacc.calibration.frames import known
from kinacc.calibration.one_thread import one_thread
from kinacc.calibration.system import PoseSystem
from kinacc.errors import InputError
from kinacc.kinematics import robot, vec

ARM = robot.load("mh180")
FREE = free_parameters(6, (2, 3))


def threads() -> set[int]:
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


@pytest.fixture
def two_threads():
    with threadpool_limits(limits=2, user_api="blas"):
        yield


@pytest.fixture
def during(monkeypatch):
    """Numbers of threads seen whenever residuals were computed."""
    seen = []
    for name in ("normal", "blocks", "residual"):
        own = getattr(PoseSystem, name)

        def watched(self, *given, own=own, **more):
            seen.append(threads())
            return own(self, *given, **more)

        monkeypatch.setattr(PoseSystem, name, watched)
    return seen


def observed(count=60):
    rng = np.random.default_rng(4)
    q_rad = simulated.joints(ARM, count, rng)
    return simulated.measure(ARM.dh, q_rad, simulated.POSE, rng)


def fit_dh(seen):
    return fitting.fit(seen, ARM.dh, free=FREE, rotation_weight_mm_per_rad=500.0, threshold=0.01)


def fit_vec(seen):
    empty = vec.without_errors(ARM.dh, seen.q_rad.min(axis=0), seen.q_rad.max(axis=0), 1)
    return vec_fit.fit(
        seen,
        empty,
        prior=vec_fit.Prior(1.0, 1e-3, 1.0, 1e-3),
        rotation_weight_mm_per_rad=500.0,
        frames=known(),
        frames_free=True,
    )


@pytest.mark.parametrize("fitted", [fit_dh, fit_vec])
def test_a_fit_takes_one_thread_and_gives_the_others_back(two_threads, during, fitted):
    fitted(observed())
    assert during
    assert all(each == {1} for each in during)
    assert threads() == {2}


def test_a_fit_that_is_refused_gives_threads_back(two_threads):
    with pytest.raises(InputError):
        fit_dh(observed(2))
    assert threads() == {2}


def test_fits_that_overlap_leave_the_threads_that_the_first_found(two_threads):
    begun, done = Event(), Event()

    def first():
        with one_thread:
            begun.set()
            done.wait()

    other = Thread(target=first)
    other.start()
    begun.wait()
    with one_thread:
        done.set()
        other.join()
        assert threads() == {1}
    assert threads() == {2}
