"""Least squares on kinematic models: observations, frames, fits, folds and residual statistics."""
