"""Figures of the report of `run`."""
