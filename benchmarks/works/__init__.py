"""One file a topic: what is measured, and the limit it cannot pass."""
