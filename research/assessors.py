"""All assessors by name: those of kinacc, and those that were no better and stand here."""

from kinacc.assess.registry import CHOOSING, PLACES, Registry

HERE = {
    "two_stage": "research.two_stage:TwoStage",
    "sequential": "research.sequential:Sequential",
    "kinematic": "research.kinematic:Kinematic",
}
ASSESSORS = Registry(PLACES | HERE)
ADAPTIVE = Registry(CHOOSING | HERE)
SLOW = {"kinematic"}  # half a second a campaign of 200 readings: simulated less often
