"""The plane that shadows fall on, and what lights it."""
