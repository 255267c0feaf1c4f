"""Measurement tables: read, checked, joined, and what their readings can tell at all."""
