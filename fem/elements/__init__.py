"""Beam and shell elements, and links condensed from them."""
