"""Stiffness indices of machining poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from robots import require_one_of
from robots.arrays import Array
from robots.constants import DOWN
from stiffarm.face.arms import Arm, Picture
from stiffarm.face.calls import ByName, called, one_or_several
from stiffarm.face.shown import Shown, frame

if TYPE_CHECKING:
    import pandas as pd

    from stiffarm.commands.index.results import IndexAnswer


@dataclass(frozen=True, repr=False)
class Indices(Shown):
    """Stiffness indices at poses: ``frame`` has one row a pose, units in the names of its columns."""

    frame: pd.DataFrame
    robot: str
    found: IndexAnswer

    def title(self) -> str:
        """Robot and number of poses."""
        return f"Stiffness indices of {self.robot} at {len(self.frame)} pose{'' if len(self.frame) == 1 else 's'}"

    def to_frame(self) -> pd.DataFrame:
        """One row a pose: joint angles, indices, distance to joint limits and singularities."""
        return self.frame

    def __getitem__(self, name: str) -> Array:
        """An index (n,) by its name, in SI: N/m or a pure number."""
        require_one_of("index", name, self.found.values, code="B003")
        return self.found.values[name]

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw cuts through the force-stiffness ellipsoid of the first poses; ``file``: a PNG to write."""
        from stiffarm.commands.index.figures import MOST_POSES, ellipsoid_figure

        asked = self.found.question
        shown = self.found.compliance[:MOST_POSES], asked.labels[:MOST_POSES]
        return Picture.of(ellipsoid_figure(*shown, asked.normal)).kept(file)


def index(
    arm: Arm,
    q_deg: ByName | Sequence[ByName],
    *,
    tip_mm: Sequence[float] | None = None,
    normal: Sequence[float] = (0.0, 0.0, 1.0),
    force_N: Sequence[float] | None = None,
    at_load_N: float | None = None,
) -> Indices:
    """Compute stiffness indices at poses: k_fs, NSPI, Rayleigh quotient, weakest and stiffest direction, isotropy.

    Parameters
    ----------
    arm : the arm
    q_deg : joint coordinates in degrees by name, for one pose or several
    tip_mm : tool tip on the flange; default: the model's tool point
    normal : of the surface, base axes
    force_N : on the tool, base axes; NSPI and the Rayleigh quotient need it
    at_load_N : load at which stiffness is stated, for an arm with effects; default: as of :func:`stiffarm.map_joints`

    Raises
    ------
    InputError
        A pose that the arm cannot take, or a vector that is no direction.

    Examples
    --------
    >>> import stiffarm as sa
    >>> arm = sa.load("kr60-3")
    >>> found = sa.index(arm, {"q2_deg": -60, "q3_deg": 40, "q5_deg": 40}, force_N=[200, 200, 200])
    >>> found["k_fs"].shape
    (1,)
    """
    from stiffarm.commands.index.results import IndexQuestion, answer, rows
    from stiffarm.session.stated import at_load

    poses = one_or_several(q_deg)
    tip = arm.robot.T_flange_tool[:3, 3] if tip_mm is None else 1e-3 * np.array(tip_mm, dtype=np.float64)
    across = np.array(normal, dtype=np.float64)
    force = None if force_N is None else np.array(force_N, dtype=np.float64)
    with called():
        q = np.stack([arm.pose(pose) for pose in poses])
        labels = tuple(str(k) for k in range(1, len(poses) + 1))
        arm = at_load(arm, at_load_N, DOWN if force is None else force, tip)
        found = answer(arm.model, IndexQuestion(q, labels, tip, across, force))
    return Indices(frame(rows(arm.robot, found)), arm.name, found)
