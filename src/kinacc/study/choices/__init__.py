"""The claims over every choice that the paper leaves open: what is varied, and what decides."""
