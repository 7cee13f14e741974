"""What lights a scene."""
