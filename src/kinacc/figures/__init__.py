"""One function per figure: tables of columns in, a matplotlib Figure out, no file access."""

import sys


def _without_help_texts() -> None:
    """Spare a stage the help text that matplotlib writes on import for ``set`` of every class.

    That is a third of the time the import takes, and only people who type ``help`` read it. So a
    session of theirs, which loads no runner of stages, keeps it.
    """
    from matplotlib.artist import Artist

    setattr(Artist, "_update_set_signature_and_docstring", classmethod(lambda cls: None))  # noqa: B010


if "kinacc.workflow.runner" in sys.modules and "matplotlib.lines" not in sys.modules:
    _without_help_texts()
