"""What every pass stands on: contexts, programs, uploads, and the caller's OpenGL state."""
