"""Through a scene by keys and mouse."""
