"""Small helpers of the report's sections: numbers in words, names, pictures."""

from __future__ import annotations

from matplotlib.figure import Figure

from stiffarm.pages.report import Picture
from stiffarm.pages.style import save_png
from stiffarm.session.outputs import OutputFolder


class Pictures:
    """Saves figures into the output folder and hands them to the report; ``before``: what their names begin with."""

    def __init__(self, folder: OutputFolder, before: str = "") -> None:
        self.folder, self.before = folder, before

    def add(self, figure: Figure, name: str, caption: str) -> Picture:
        """Save a figure under ``figures/`` and return it with its caption."""
        path = self.folder.path(f"figures/{self.before}{name}.png")
        save_png(figure, path)
        return Picture(path, caption, name.replace("_", " "))
