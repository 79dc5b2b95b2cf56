"""What a calibrated arm can be used for: predict, compensate, compare; from a results folder."""
