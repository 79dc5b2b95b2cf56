"""The study of the paper: points, maps, simulations, histories, claims."""
