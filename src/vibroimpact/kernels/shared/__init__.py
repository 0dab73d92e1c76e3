"""What the kernels of one mass and of systems share: how they are compiled, vectors of lanes, bounds and series."""
