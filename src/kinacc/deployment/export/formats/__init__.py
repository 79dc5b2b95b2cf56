"""Formats of ``kinacc export``, one module each.

A module has the ENDING of its files, ``ANY_MODEL`` where it carries models that are no DH table,
and ``text(source)``, which returns the text of the file.
"""
