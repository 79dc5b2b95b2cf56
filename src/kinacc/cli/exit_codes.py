"""How commands end; docs/commands.md lists what each code means."""

DONE, AGAINST, UNUSABLE, UNDECIDED = 0, 1, 2, 3
STOPPED, NOBODY_READS, TERMINATED = 130, 141, 143  # as a shell has them of signals
