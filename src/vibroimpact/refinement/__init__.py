"""Fine pictures at the cost of their boundaries."""
