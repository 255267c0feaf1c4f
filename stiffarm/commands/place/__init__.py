"""The command `place`."""
