"""The face of stiffarm: command line, reports, pictures."""

from importlib.metadata import version

__version__ = version("stiffarm")
