"""Where copies stand, and which picture of its fan each shows."""
