"""Which poses to measure: observability of the kinematic parameters, exchange, order of travel."""
