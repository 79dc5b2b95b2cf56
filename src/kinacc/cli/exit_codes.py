"""How commands end: the one table of exit codes; ``tools/document_commands.py`` writes it down."""

from __future__ import annotations

DONE, AGAINST, UNUSABLE = 0, 1, 2
STOPPED, NOBODY_READS, TERMINATED = 130, 141, 143  # as a shell has them of signals

# What each means of every command, and what a build server makes of it.
EXIT_CODES: dict[int, tuple[str, str]] = {
    DONE: ("done, and nothing speaks against the answer", "passed"),
    AGAINST: (
        "done, and the answer is not all one would want (below, by command); or it could not be "
        "finished: memory, a full disk, a step of the workflow that failed, a run at work there",
        "failed",
    ),
    UNUSABLE: ("the input or an option cannot be used; nothing was written", "failed"),
    STOPPED: ("stopped by Ctrl-C; what was finished is kept", "failed"),
    NOBODY_READS: ("nobody reads what is printed any more, as after `head`", "failed"),
    TERMINATED: ("stopped by the system; what was finished is kept", "failed"),
}

# Commands that judge, or that stand in a pipeline: what their 0, 1 and 2 mean. An empty
# one comes only where the command could not finish.
OF_COMMANDS: dict[str, tuple[str, str, str]] = {
    "add": ("the line stands in the configuration", "", "refused; the configuration is as it was"),
    "check-results": (
        "every check passed, only warned, or cannot tell where that is no failure",
        "at least one check failed, or a file is missing or damaged",
        "the folder, a configuration or an option cannot be used",
    ),
    "check-data": (
        "nothing suspicious",
        "there are suspicions",
        "a file or its description cannot be used",
    ),
    "verify": (
        "PASS",
        "FAIL or UNDECIDED",
        "the readings, the folder or an option cannot be used",
    ),
    "summary": (
        "every data set is accepted",
        "a data set has no results to tell of, or its verdict is not accept",
        "a folder or an option cannot be used",
    ),
}
