"""Sections and keys of the configuration that are gone, and where to find what they did."""

from __future__ import annotations

REMOVED_KEYS = {
    "choices": "the claims over open choices are in research/ (research/config.yaml)",
    "map_readings": "the readings of Fig. 3 are in research/ (research/config.yaml)",
    "tournament": "the tournament is in research/ (research/config.yaml)",
}
