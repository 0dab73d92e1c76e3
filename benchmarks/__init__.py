"""Comparison of the engine with other programs; `make bench` runs all measurements."""
