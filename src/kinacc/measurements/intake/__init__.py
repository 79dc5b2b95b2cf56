"""A first look at a measurement file nobody has described: its text, its columns, its units."""
