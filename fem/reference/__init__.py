"""Slower ways to the same results, to check the statics by; none of them knows of unit loads."""
