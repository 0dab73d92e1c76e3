"""Published studies carried out with the package, each a user of its public functions."""
