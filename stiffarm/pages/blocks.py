"""Small helpers of the report's sections: numbers in words, names, pictures."""

from __future__ import annotations

from matplotlib.figure import Figure

from stiffarm.pages.report import Picture
from stiffarm.pages.style import save_png
from stiffarm.session.outputs import OutputFolder

# A relative error below this is round-off to whoever asks.
TINY = 1e-6


class Pictures:
    """Saves figures into the output folder and hands them to the report; ``before``: what their names begin with."""

    def __init__(self, folder: OutputFolder, before: str = "") -> None:
        self.folder, self.before = folder, before

    def add(self, figure: Figure, name: str, caption: str) -> Picture:
        """Save a figure under ``figures/`` and return it with its caption."""
        path = self.folder.path(f"figures/{self.before}{name}.png")
        save_png(figure, path)
        return Picture(path, caption, name.replace("_", " "))


def percent(value: float) -> str:
    """A relative error in percent (hard space); what is smaller than anybody can heed is only said to be so."""
    if 0.0 < value < TINY:
        return "below 0.0001\u00a0%"
    return f"{value * 100:.0f}\u00a0%" if value >= 0.1 else f"{value * 100:.2g}\u00a0%"
