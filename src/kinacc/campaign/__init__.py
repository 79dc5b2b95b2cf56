"""A measuring campaign on disk: what to measure next, what was read, what may be said."""
