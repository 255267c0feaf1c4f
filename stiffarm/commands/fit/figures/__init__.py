"""Figures of a surrogate."""
