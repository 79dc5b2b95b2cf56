"""One BLAS thread while a fit runs: the matrices are small, more threads only wait."""

from __future__ import annotations

import scipy.linalg  # noqa: F401 (so that its BLAS library is limited too)
from threadpoolctl import ThreadpoolController

one_thread = ThreadpoolController().wrap(limits=1, user_api="blas")
