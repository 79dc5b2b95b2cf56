"""Measurement files as tables in millimetres and radians, or a list of all that is wrong."""
