"""The `reference` back end: plain NumPy and SciPy, no kernel; an independent witness."""
