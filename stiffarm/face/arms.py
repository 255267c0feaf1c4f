"""Robot arms: loaded by name or from a file, described, drawn, saved, loaded with forces."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import fem.arm
from robots import InputError, bundled_names, save_description
from robots.constants import DOWN
from stiffarm.face.calls import called
from stiffarm.face.shown import frame
from stiffarm.pages.picture import Picture
from stiffarm.request import ByName, pose_of
from stiffarm.session import inputs

if TYPE_CHECKING:
    import pandas as pd


class Arm(fem.arm.Arm):
    """A robot arm: its file's content, kinematics, mechanics and effects in one object.

    Made by :func:`stiffarm.load`, or found as ``arm`` of a calibration or a diagnosis.
    """

    @property
    def name(self) -> str:
        """The robot's name."""
        return self.robot.name

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the joint coordinates, with their unit."""
        return self.robot.coordinates

    def __repr__(self) -> str:
        m = self.model
        rigid = len(self.joints_without_springs)
        springs = f"{len(m.joints) - rigid} of {len(m.joints)} joints with a spring"
        return f"Arm {self.name}: {m.link_kind} links, {m.load_path} load path, {springs}"

    def describe(self) -> pd.DataFrame:
        """One row a joint: its range in degrees, and its stiffness about the axis at mid-range in N m/rad.

        A joint without a spring has the stiffness inf: it is rigid in this model.
        """
        here = self.robot.limits.mean(axis=1)[None]
        compliance = [float(joint.axial.compliance(here)[0]) for joint in self.model.joints]
        low, high = np.degrees(self.robot.limits).T
        return frame(
            {
                "joint": self.robot.joint_names,
                "coordinate": self.coordinates,
                "from_deg": low,
                "to_deg": high,
                "stiffness_Nm_per_rad": [1.0 / c if c else np.inf for c in compliance],
            }
        )

    def save(self, file: str | Path) -> Path:
        """Write the arm as a model TOML, with where each value came from; returns the path."""
        path = Path(file)
        if path.suffix.lower() != ".toml":
            raise InputError(
                "model file", code="B004", value=str(path), allowed="a name ending in .toml", remedy="add .toml"
            )
        save_description(self.description, path)
        return path

    def plot(
        self,
        file: str | Path | None = None,
        *,
        q_deg: Mapping[str, float] | None = None,
        direction: Sequence[float] = DOWN,
    ) -> Picture:
        """Draw the arm in a pose with the load's direction as an arrow; ``file``: a PNG to write.

        ``q_deg``: joint coordinates in degrees by name; one that is not named is 0, where the arm can take that.
        """
        from stiffarm.pages.pose_pictures import pose_pictures

        q = self.pose(q_deg)
        along = np.array(direction, dtype=float)[None] / np.linalg.norm(direction)
        (text,) = pose_pictures(self.description, self.robot, q[None], along)
        return Picture(base64.b64decode(text)).kept(file)

    def pose(self, q_deg: ByName | None) -> Any:
        """Joint coordinates (dof,) in rad of a pose given in degrees by name.

        Raises
        ------
        InputError
            A name that this robot does not have, an angle that is no finite number, or a pose it cannot take.
        """
        if q_deg is None:
            from stiffarm.commands.plan.options import resting_pose

            return resting_pose(self.robot, {})
        return pose_of(self.robot, q_deg, "q_deg")


def load(
    model: str | Path,
    *,
    links: str | None = None,
    load_path: str | None = None,
    values: Mapping[str, float | str] | None = None,
) -> Arm:
    """A robot arm by bundled name, from a model TOML or from a URDF.

    Parameters
    ----------
    model : a bundled name (:func:`stiffarm.robots_bundled`) or a path
    links : "beam", "shell" or "rigid"; default: as the model was calibrated, else beam
    load_path : "parallelogram" or "serial"; default: the model's
    values : parameter name -> value in place of the model's, SI or text with a unit, as in ``{"j2.stiffness": 1.4e6}``

    Raises
    ------
    InputError
        No such model, a file that does not fit the schema, a parameter that the arm does not have, or an arm too soft
        for linear statics.

    Examples
    --------
    >>> import stiffarm as sa
    >>> sa.load("xr701", values={"j2.stiffness": 1.4e6}).name
    'xr701'
    """
    with called():
        return as_face(inputs.read_model(str(model), links, load_path, sets=values))


def robots_bundled() -> tuple[str, ...]:
    """Names of the bundled robots."""
    return bundled_names()


def as_face(arm: fem.arm.Arm) -> Arm:
    """The arm as users hold it."""
    return Arm(arm.description, arm.robot, arm.model, arm.effects, arm.own, arm.source)
