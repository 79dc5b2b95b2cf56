#!/usr/bin/env python3
"""Compare two results folders: python tools/compare_results.py BEFORE NOW

Prints each column that differs beyond its tolerance. Exit code 0: the same; 1: something differs.
"""

import sys
from pathlib import Path

from kinacc.tables.comparison import compare_folders

if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    found = list(compare_folders(Path(sys.argv[1]), Path(sys.argv[2])))
    print("\n".join(map(str, found)) or "no difference")
    sys.exit(1 if found else 0)
