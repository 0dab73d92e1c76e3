"""The engine of systems: their modal motion, computed in lanes."""
