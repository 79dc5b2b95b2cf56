"""One BLAS thread while a fit runs, in whatever process it runs.

The matrices of a fit are small: more threads wait for each other, and where others use the cores a
fit becomes many times slower. Most BLAS libraries have one number of threads for the process, so
what other threads of it compute meanwhile runs on one BLAS thread too. The last of fits that
overlap gives back the number that the first one found.
"""

from __future__ import annotations

from contextlib import ContextDecorator
from functools import cached_property
from threading import Lock, local
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import LibController

_OF_ITS_THREAD = ("mkl", "openmp")  # libraries and threading layers with a number for each thread


class OneThread(ContextDecorator):
    """Hold BLAS to one thread, as a context or around a function; may be nested and shared."""

    def __init__(self) -> None:
        self._lock, self._inside, self._before = Lock(), 0, ()
        self._thread = local()

    def __enter__(self) -> None:
        shared, own = self._libraries
        with self._lock:
            if self._inside == 0:
                self._before = _set(shared, [1] * len(shared))
            self._inside += 1
        stack = self._thread.__dict__.setdefault("before", [])
        stack.append(_set(own, [1] * len(own)))

    def __exit__(self, *raised: object) -> None:
        shared, own = self._libraries
        _set(own, self._thread.before.pop())
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                _set(shared, self._before)

    @cached_property
    def _libraries(self) -> tuple[list[LibController], list[LibController]]:
        """BLAS libraries with one number of threads for all, and with one for each thread."""
        import scipy.linalg  # noqa: F401 (its library is looked for too, once)
        from threadpoolctl import ThreadpoolController

        found = ThreadpoolController().select(user_api="blas").lib_controllers
        apart = [
            each.internal_api in _OF_ITS_THREAD
            or getattr(each, "threading_layer", None) in _OF_ITS_THREAD
            for each in found
        ]
        shared = [each for each, alone in zip(found, apart, strict=True) if not alone]
        return shared, [each for each, alone in zip(found, apart, strict=True) if alone]


def _set(libraries: list[LibController], counts: list[int]) -> list[int]:
    """The numbers of threads before they become ``counts``."""
    before = [each.num_threads for each in libraries]
    if before == counts:
        return before
    from threadpoolctl import OpenBLASController

    # Which thread has begun and which one ends is settled here, not by who asked first.
    OpenBLASController.clear_controlling_thread(force=True)
    for each, count in zip(libraries, counts, strict=True):
        each.set_num_threads(count)
    OpenBLASController.clear_controlling_thread(force=True)
    return before


one_thread = OneThread()
