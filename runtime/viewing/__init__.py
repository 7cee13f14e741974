"""Who looks: cameras, and what passes know of them."""
