"""Small helpers of the report's sections: numbers in words, names, pictures."""

from __future__ import annotations

from matplotlib.figure import Figure

from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.run.workflow import Findings
from stiffarm.pages.report import Picture
from stiffarm.pages.style import save_png
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.spring_words import spring_text
from stiffarm.session.steps import bundled_sha256


class Pictures:
    """Saves figures into the output folder and hands them to the report."""

    def __init__(self, folder: OutputFolder) -> None:
        self.folder = folder

    def add(self, figure: Figure, name: str, caption: str) -> Picture:
        """Save a figure under ``figures/`` and return it with its caption."""
        path = self.folder.path(f"figures/{name}.png")
        save_png(figure, path)
        return Picture(path, caption, name.replace("_", " "))


def percent(value: float) -> str:
    """A relative error in percent (hard space), or as a power of ten where percent would be all zeros."""
    if 0.0 < value < 1e-6:
        return f"{value:.0e}"
    return f"{value * 100:.0f}\u00a0%" if value >= 0.1 else f"{value * 100:.2g}\u00a0%"


def short_title(findings: Findings) -> str:
    """The robot's title without what stands in brackets."""
    return findings.given.description.title.split(" (")[0]


def is_published_data(findings: Findings) -> bool:
    """Whether this is the bundled data set, of which the paper's own remarks and doubts hold."""
    return findings.data.sha256 == bundled_sha256(findings.given.robot.name)


def springs_text(variant: Calibrated) -> str:
    """Constant springs with their intervals, in words."""
    if variant.found.studies:
        return "depend on angle (see the figure above)"
    return "; ".join(f"{s.joint} {spring_text(s)}" for s in variant.springs)
