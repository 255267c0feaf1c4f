"""Measurement sets by motors (dual quaternions) and the least energy of an arm that finds its rest where it is bent to.

A world of its own, which shares no code with the program that is judged on its sets, nor with other worlds.
"""

from .sets import fill, make

__all__ = ["fill", "make"]
