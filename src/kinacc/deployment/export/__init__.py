"""A calibrated arm in the forms others read: robot file, JSON, CSV, URDF, tables for a paper."""
