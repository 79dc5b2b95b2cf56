"""Slow, plain implementations of the paper's equations, written without looking at kinacc's own.

They follow the paper, its reading (README, "How the paper was read") and the artefact contract, one
pose, one point or one iteration at a time, so that agreement with the fast code means something.
"""
