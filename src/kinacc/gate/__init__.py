"""Results held to what is good enough, and to the accepted run; what build servers read of it."""
