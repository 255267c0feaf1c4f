"""Words that several chapters of the report share."""

from __future__ import annotations

from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.run.findings import Findings
from stiffarm.session.spring_words import spring_text
from stiffarm.session.steps import bundled_sha256


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
