"""Figures of a map."""
