"""Meshes textured by Polynomial Texture Maps."""
