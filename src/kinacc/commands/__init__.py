"""Commands that use a calibration; one module each, loaded only when called."""
