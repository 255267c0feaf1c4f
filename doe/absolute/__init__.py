"""Absolute readings: positions of targets in a tracker's frame, and what of the arm they identify."""
