"""Polygon meshes beside the fans."""
