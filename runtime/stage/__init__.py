"""A scene file on the GPU."""
