"""The workflow: what its stages read and leave, how they run, whether results can be trusted."""
