"""Posture: the best gamma and branch at a point and along a path."""
