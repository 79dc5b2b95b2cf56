"""Pages a person reads in a browser: one file each, with pictures to explore and no network."""
