"""Computing the cells of a request part by part, and keeping them in a store."""
