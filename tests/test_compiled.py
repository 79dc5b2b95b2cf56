"""Compiled kernels also run where neither the package nor the user's cache can be written."""

from __future__ import annotations

import subprocess
import sys


def test_kernels_are_compiled_where_nothing_can_be_kept():
    lines = (
        "import numba.core.caching as caching",
        "caching.CacheImpl._locator_classes = []",
        "from kinacc.compiled import compiled",
        "print(compiled(lambda x: 2 * x)(3))",
    )
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True)
    assert done.stdout.split() == ["6"], done.stderr
