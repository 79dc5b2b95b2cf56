"""What is said to libraries before they are imported, so that commands and stages start soon."""

from __future__ import annotations

import sys
from importlib.util import LazyLoader, find_spec, module_from_spec

# Of BLAS, which reads it when numpy is first imported: more threads change the last bits of a sum,
# and wait for each other over matrices as small as these.
ONE_THREAD = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"), "1"
)


def without_tools_of_numpy() -> None:
    """Keep SciPy from importing numpy's Fortran compiler and test tools, 0.07 s of CPU time.

    It copies every name of numpy, which imports what is behind it. They are imported as soon as
    anything of them is used.
    """
    import numpy

    for name in ("f2py", "testing"):
        full = f"numpy.{name}"
        spec = None if full in sys.modules else find_spec(full)
        if spec is None or spec.loader is None:
            continue
        spec.loader = LazyLoader(spec.loader)
        module = sys.modules[full] = module_from_spec(spec)
        setattr(numpy, name, module)
        spec.loader.exec_module(module)
