"""Kinematic models: frozen records of parameters and batched pure functions over joint arrays."""
