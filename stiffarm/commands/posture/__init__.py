"""The command `posture`."""
