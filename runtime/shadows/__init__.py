"""Shadows on the ground: of strips, of meshes, soft, and around the feet."""
