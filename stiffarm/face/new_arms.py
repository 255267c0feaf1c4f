"""New arms: a model from a data sheet, and its kinematics held against what a controller shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robots import ModelDescription, Robot, require_positive
from stiffarm.face.arms import Arm
from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame
from stiffarm.pages.picture import Picture

if TYPE_CHECKING:
    import pandas as pd

    from robots.pendant.check import PendantCheck


@dataclass(frozen=True, repr=False)
class KinematicsCheck(Shown):
    """A model's kinematics beside positions read at the controller.

    ``verdict``: "agrees", "explained", "orientation" (only that is off), "misread" (a few poses, which are named) or
    "unexplained"; ``largest_mm``: difference as the model stands; ``remedies``: what to write in the model, by what is
    wrong. ``content`` has everything else.
    """

    verdict: str
    largest_mm: float
    remedies: Mapping[str, str]
    content: Mapping[str, Any]
    robot: Robot
    found: PendantCheck
    description: ModelDescription

    def title(self) -> str:
        """The answer, and what is wrong."""
        from stiffarm.commands.robots import check_words

        lines = check_words.told_in_paragraphs(dict(self.content))
        return " ".join([f"{check_words.headline(self.description.title, dict(self.content))}.", *lines])

    def to_frame(self) -> pd.DataFrame:
        """One row a pose: readings less model, distance, and what is left when all that is named is put right."""
        rows = []
        for one in self.content["by_pose"]:
            off = dict(zip(("dx_mm", "dy_mm", "dz_mm"), one["read_less_model_mm"], strict=True))
            rows.append({"pose": one["pose"], **off, "distance_mm": one["distance_mm"], "put_right_mm": one["then_mm"]})
        return frame(rows)

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw the arm, and its tool as modelled and as read; ``file``: a PNG to write."""
        from stiffarm.commands.robots.check_report import skeleton_figure

        return Picture.of(skeleton_figure(self.robot, self.found)).kept(file)


def check_kinematics(arm: Arm, pendant: str | Path, *, tolerance_mm: float = 1.0) -> KinematicsCheck:
    r"""Hold a model's kinematics against positions read at the controller, and name what is wrong.

    Parameters
    ----------
    arm : the arm as its model has it
    pendant : table (CSV or XLSX) with a row a pose: angles in deg, x_mm, y_mm, z_mm as the controller shows them
    tolerance_mm : positions closer than this agree

    Raises
    ------
    InputError
        Every fault of the table, or fewer than three poses that differ.

    Examples
    --------
    >>> import stiffarm as sa, tempfile
    >>> file = tempfile.mkdtemp() + "/pendant.csv"
    >>> head, read = "q1_deg,q2_deg,q3_deg,x_mm,y_mm,z_mm", ["0,-90,90,495,0,675", "10,-20,30,1102.6,194.4,105.6"]
    >>> _ = open(file, "w").write("\n".join([head, *read, "30,-60,60,796.7,460.0,561.1"]))
    >>> sa.check_kinematics(sa.load("kr60-3", links="rigid"), file).verdict
    'agrees'
    """
    from robots.pendant.check import check_pendant
    from stiffarm.commands.robots.check import check_payload
    from stiffarm.commands.robots.pendant_table import read_pendant

    with called():
        require_positive("--tolerance-mm", tolerance_mm, "mm", code="B003")
        readings, convention, _ = read_pendant(Path(pendant), arm.robot, arm.name)
        found = check_pendant(arm.robot, readings, 1e-3 * tolerance_mm)
        content = check_payload(arm.description, arm.robot, found, convention)
    first = (content["explanations"] or [content["closest"]])[0]
    named = [] if first is None else first["changes"]
    return KinematicsCheck(
        content["verdict"],
        content["largest_mm"],
        {one["words"]: one["remedy"] for one in named},
        content,
        arm.robot,
        found,
        arm.description,
    )
