"""One BLAS thread while a fit runs: the matrices are small, more threads only wait."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import scipy.linalg  # noqa: F401 (so that its BLAS library is limited too)
from threadpoolctl import ThreadpoolController

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")
_CONTROLLER = ThreadpoolController()


def one_thread(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
    """Limit BLAS to one thread while ``function`` runs."""
    limited: Callable[_Parameters, _Result] = _CONTROLLER.wrap(limits=1, user_api="blas")(function)
    return limited
