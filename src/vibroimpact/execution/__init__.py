"""Cells of a request, computed part by part, and kept in a store."""
