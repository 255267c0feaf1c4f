"""Inputs for CalculiX, an independent code."""
