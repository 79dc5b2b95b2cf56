"""Numba's compiler as all kernels ask for it, also where no folder can keep what it compiles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(function: Callable[..., Any], **options: Any) -> Any:
    """``function`` compiled at its first call; kept for other processes where that is possible.

    It must not call helpers of another file: numba would not see them change.
    """
    try:
        return njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # no folder to keep it in, unless NUMBA_CACHE_DIR names one
        return njit(nogil=True, **options)(function)
