"""Assessors of accuracy: :mod:`kinacc.assess.registry` lists them, one file each."""
