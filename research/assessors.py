"""All assessors by name: those of kinacc, and those that were no better and stand here."""

from kinacc.assess import registry
from research.kinematic import Kinematic
from research.sequential import Sequential
from research.two_stage import TwoStage

HERE: dict[str, type] = {each.name: each for each in (TwoStage, Sequential, Kinematic)}
ASSESSORS = registry.ASSESSORS | HERE
ADAPTIVE = registry.ADAPTIVE | HERE
SLOW = {"kinematic"}  # half a second a campaign of 200 readings: simulated less often
