"""Robot kinematic model accuracy: calibrate, map the error, and state how large it can be."""

__version__ = "0.1.0"
