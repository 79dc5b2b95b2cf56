"""The configuration: one schema, loading with every problem at once, and the documented file."""
