"""Measurements of the engine beside what else one could use; `make bench` runs them all."""
