"""From a fan's tiles to lit quads."""
