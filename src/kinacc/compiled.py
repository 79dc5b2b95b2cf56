"""Numba's compiler as all kernels ask for it, also where nothing can be kept.

Compiled code is kept beside the package or, where that cannot be written, in the user's cache
folder; numba keys what it keeps by the kind of processor, so machines of several kinds may share
it. Where neither can be written every process compiles anew, and says so once.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, Literal

from numba import njit
from numba.np import linalg as _linear_algebra

_told = False


def _set_up_without_scipy() -> None:
    """Have numba load its functions of arrays without scipy, half of what they take to load.

    It loads scipy.linalg to see whether there is a BLAS. There is, as kinacc needs scipy; a kernel
    that calls it has it loaded when it is compiled.
    """
    look = _linear_algebra.ensure_blas
    _linear_algebra.ensure_blas = lambda: None
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        _linear_algebra.ensure_blas = look


_set_up_without_scipy()


def compiled(function: Callable[..., Any]) -> Any:
    """``function`` compiled at its first call; kept for other processes where that is possible.

    It must not call helpers of another file: numba would not see them change.
    """
    return _compiled(function, "python")


def compiled_without_checks(function: Callable[..., Any]) -> Any:
    """As ``compiled``, but a division by zero gives what IEEE 754 says, as in numpy."""
    return _compiled(function, "numpy")


def _compiled(function: Callable[..., Any], error_model: Literal["python", "numpy"]) -> Any:
    global _told
    try:
        return njit(cache=True, nogil=True, error_model=error_model)(function)
    except RuntimeError:  # no folder to keep it in
        if not _told:
            _told = True
            print(
                "kinacc compiles its kernels anew in every process (some seconds), as it can write "
                "neither to its own folder nor to the user's cache; NUMBA_CACHE_DIR can name "
                "another folder.",
                file=sys.stderr,
            )
        return njit(nogil=True, error_model=error_model)(function)
