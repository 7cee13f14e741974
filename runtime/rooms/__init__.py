"""Surroundings: environments on the GPU, rooms as a background, as lights, and taken from a scene."""
