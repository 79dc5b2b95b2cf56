"""What a file of measurements holds and what is wrong with it, before anything is fitted."""
