"""``python -m kinacc.cli``, as ``kinacc``."""

from kinacc.cli.process import main

main()
