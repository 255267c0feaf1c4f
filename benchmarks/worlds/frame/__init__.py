"""Measurement sets by OpenSees: arms as frames of beams and springs, whose materials remember by themselves.

A world of its own, which shares no code with the program that is judged on its sets, nor with other worlds.
"""

from .sets import fill, make

__all__ = ["fill", "make"]
