"""Figures of a posture along a path."""
