"""Simulation: the displacement of the tool at a pose under a load, part by part, or of every reading of a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from stiffarm.face.arms import Arm
from stiffarm.face.calls import ByName, called, in_order
from stiffarm.face.readings import AnyReadings, table_of
from stiffarm.face.shown import Shown, frame
from stiffarm.session.parsing import WRENCH_NAMES

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Simulation(Shown):
    """The tool's displacement at one pose under one load.

    ``displacement``: mm and mrad by name, ``dz_mm`` below zero under a downward load; ``stiffness_N_per_mm``: the
    force over the displacement along it, None for a rigid arm or without a force; ``interval95_N_per_mm``: ends of its
    95 % interval by the calibration, None where nothing is known, an open upper end None; ``by_part``: what each part
    adds.
    """

    displacement: Mapping[str, float]
    stiffness_N_per_mm: float | None  # noqa: N815 - the unit as the shop writes it
    interval95_N_per_mm: tuple[float, float | None] | None  # noqa: N815 - as above
    by_part: Mapping[str, Mapping[str, float]]
    robot: str

    def title(self) -> str:
        """Robot, and its stiffness along the force."""
        k = self.stiffness_N_per_mm
        return f"Simulation of {self.robot}" + ("" if k is None else f": {k:.6g} N/mm along the force")

    def to_frame(self) -> pd.DataFrame:
        """One row a part, and their sum: displacements in mm and rotations in mrad."""
        rows = [{"part": name, **moved} for name, moved in self.by_part.items()]
        return frame([*rows, {"part": "total", **self.displacement}])


@dataclass(frozen=True, repr=False)
class Replayed(Shown):
    """Readings beside what the model says of them: ``rms_mm`` is their difference; ``frame`` has one row a reading."""

    rms_mm: float | None
    frame: pd.DataFrame
    robot: str

    def title(self) -> str:
        """Robot, and the RMS difference."""
        rms = "" if self.rms_mm is None else f": RMS difference {self.rms_mm:.4f} mm"
        return f"Readings of {self.robot}, measured and simulated{rms}"

    def to_frame(self) -> pd.DataFrame:
        """One row a reading: pose, load, and each component measured and simulated."""
        return self.frame


def simulate(arm: Arm, q_deg: ByName, load: ByName, *, rigid_joints: bool = False) -> Simulation:
    """Simulate the displacement of the tool at a pose under a load, relative to the unloaded arm.

    Parameters
    ----------
    arm : the arm
    q_deg : joint coordinates in degrees by name; one that is not named is 0
    load : force and moment at the tool point by name, base axes, as ``{"fz_N": -650}``
    rigid_joints : let only the links deflect

    Raises
    ------
    InputError
        A pose that the arm cannot take, an unknown name, or a displacement beyond linear statics.

    Examples
    --------
    >>> import stiffarm as sa
    >>> s = sa.simulate(sa.load("xr701"), {"q2_deg": 5, "q3real_deg": 77.5}, {"fz_N": -650})
    >>> s.displacement["dz_mm"] < 0
    True
    """
    from stiffarm.commands.simulate.step import of_pose

    wrench = np.array(in_order(load, WRENCH_NAMES, "load"))
    with called():
        found = of_pose(arm, arm.pose(q_deg), wrench, rigid_joints)
    ends = found["interval95_N_per_mm"]
    known = None if ends is None else (ends[0], ends[1])
    return Simulation(found["displacement"], found["stiffness_N_per_mm"], known, found["by_part"], arm.name)


def replay(arm: Arm, readings: AnyReadings, *, rigid_joints: bool = False) -> Replayed:
    """Simulate every reading of a table, its effects and load history included.

    Parameters
    ----------
    arm : the arm
    readings : measured deflections (:func:`stiffarm.read_readings`)
    rigid_joints : let only the links deflect, without effects

    Raises
    ------
    InputError
        Every displacement is beyond linear statics.

    Examples
    --------
    >>> import stiffarm as sa
    >>> arm = sa.load("xr701")
    >>> len(sa.replay(arm, sa.read_readings(sa.bundled("xr701"), arm)).to_frame())
    27
    """
    from stiffarm.commands.simulate.readings import of_table

    with called():
        found: dict[str, Any] = of_table(arm, table_of(readings, arm), rigid_joints)
    return Replayed(found["rms_mm"], frame(found["readings"]), arm.name)
