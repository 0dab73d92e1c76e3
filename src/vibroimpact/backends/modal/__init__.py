"""The engine of systems: what is seen of their modes, in lanes."""
