"""``python -m benchmarks.worlds.equilibrium make OUT --seed N`` and ``... fill SET SHEET OUT --visit K``."""

from ..shared import command
from .sets import fill, make

command(make, fill)
