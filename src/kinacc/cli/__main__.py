"""``python -m kinacc.cli``, as ``kinacc``."""

from kinacc.cli.group import main

main(prog_name="kinacc")
