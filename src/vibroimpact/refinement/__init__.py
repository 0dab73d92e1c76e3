"""Fine pictures at the cost of their boundaries."""

from vibroimpact.refinement.maps import refined_map, to_uniform

__all__ = ["refined_map", "to_uniform"]
