"""Simulated controllers, arms and programs of five makers; nothing here imports kinacc."""
