"""How each mesh format becomes parts; `impostor.model` puts the parts together."""
