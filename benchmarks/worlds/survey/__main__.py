"""``python -m benchmarks.worlds.survey make OUT --seed N``."""

from ..shared import command
from .sets import make

command(make)
