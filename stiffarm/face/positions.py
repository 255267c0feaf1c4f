"""Calibration from absolute positions of targets: how accurate an arm is, before and after, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fem import LinkKind
from robots import InputError
from robots.arrays import Array
from stiffarm.face.arms import Arm, Picture, as_face
from stiffarm.face.calibrations import Identified
from stiffarm.face.calls import called, words_of
from stiffarm.face.shown import Shown, frame

if TYPE_CHECKING:
    import pandas as pd

    from doe.absolute.calibrate import Positions
    from doe.absolute.readings import AbsoluteReadings


@dataclass(frozen=True, repr=False)
class PositionCalibration(Shown):
    """A finished calibration from positions. ``calibration["j3.zero"]`` is one of its parameters.

    ``arm``: the calibrated arm, to be saved as a model file; ``before_rms_mm``: RMS of the distances with the arm as
    described, ``rms_mm``: calibrated; ``left_out_rms_mm``: of poses that took no part; ``sessions_out_rms_mm``: of
    whole sessions, their frames fitted, None with one; ``holdout_rms_mm``: of readings kept out, None without any;
    ``wrong``: readings that no scatter explains, in words, which are left aside; ``remarks``: what the reader must
    know. ``found`` has all else.
    """

    name: str
    arm: Arm
    parameters: tuple[Identified, ...]
    before_rms_mm: float
    rms_mm: float
    left_out_rms_mm: float
    sessions_out_rms_mm: float | None
    holdout_rms_mm: float | None
    wrong: tuple[str, ...]
    remarks: tuple[str, ...]
    found: Positions

    def __getitem__(self, name: str) -> Identified:
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise InputError("parameter", code="B003", value=name, allowed=", ".join(p.name for p in self.parameters))

    def title(self) -> str:
        """Robot and accuracy."""
        return (
            f"Positions of {self.name}: RMS {self.before_rms_mm:.3f} mm as described, {self.rms_mm:.3f} mm calibrated, "
            f"{self.left_out_rms_mm:.3f} mm at poses left out"
        )

    def to_frame(self) -> pd.DataFrame:
        """One row a parameter: name, value, unit, ends of the 95 % interval, status."""
        return frame(
            {
                "parameter": [p.name for p in self.parameters],
                "value": [float("nan") if p.value is None else p.value for p in self.parameters],
                "unit": [p.unit for p in self.parameters],
                "low95": [p.interval95[0] for p in self.parameters],
                "high95": [p.interval95[1] for p in self.parameters],
                "status": [p.status for p in self.parameters],
            }
        )

    def curve(self, joint: str) -> pd.DataFrame:
        """A joint's error over its angle by the degree; NaN where the readings do not identify it.

        Raises
        ------
        InputError
            A joint without an error curve.
        """
        for one in self.found.curves:
            if one.joint == joint:
                error, half = (np.where(one.known, 1e3 * x, np.nan) for x in (one.error, one.half95))
                return frame({"angle_deg": np.degrees(one.angle), "error_mrad": error, "half95_mrad": half})
        known = ", ".join(c.joint for c in self.found.curves)
        raise InputError("joint", code="B003", value=joint, allowed=known or "none, for periodic was not free")

    def save_urdf(self, file: str | Path) -> Path:
        """Write the calibrated arm as a URDF: frames and zeros of its joints as they really are; returns the path."""
        from robots.files.written import write_whole
        from robots.urdf.writing import urdf_text

        path = Path(file)
        if path.suffix.lower() != ".urdf":
            raise InputError(
                "URDF file", code="B004", value=str(path), allowed="a name ending in .urdf", remedy="add .urdf"
            )
        comment = f"stiffarm: calibrated from positions {self.found.found.data.source}"
        write_whole(path, urdf_text(self.arm.robot, comment=comment))
        return path

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw how many readings are nearer than a distance, before and after; ``file``: a PNG to write."""
        from stiffarm.commands.calibrate.positions.figures import accuracy_figure

        return Picture.of(accuracy_figure(self.found)).kept(file)


def calibrate_positions(
    arm: Arm,
    source: str | Path | pd.DataFrame | Sequence[str | Path | pd.DataFrame],
    *,
    free: Sequence[str] | str | None = None,
    holdout: str | Path | pd.DataFrame | None = None,
    robust: bool = True,
    seed: int = 0,
) -> PositionCalibration:
    """Find frames, geometry, joint errors and springs of an arm from positions of targets on its flange.

    Parameters
    ----------
    arm : the arm as described; it is not changed
    source : a table with joint angles and x_mm, y_mm, z_mm in a tracker's frame (CSV or XLSX), a data frame with the
        same columns, or several of them
    free : groups ("geometry", "periodic", "springs" ...) or single parameters ("j2.zero"); default: geometry,
        springs, periodic and, with a rail, rail
    holdout : a table that the calibration does not see; frames of its new sessions are fitted, nothing else
    robust : readings far out lose weight
    seed : of the random parts that are left out

    Raises
    ------
    InputError
        A table that cannot be read, positions that no frame brings together with the arm, or an unknown name.
    """
    from doe.absolute.calibrate import calibrate_positions as calibrated
    from doe.absolute.written import written

    with called():
        table, kept = read_positions(source, holdout, arm)
        found = calibrated(arm.model, table, words_of(free, "free"), holdout=kept, robust=robust, seed=seed)
        model = written(found, arm.description)
        links: LinkKind = "rigid" if model.fit.moving.of("spring") else arm.model.link_kind
        made = arm.of(model.description, links, arm.model.load_path, arm.own)
    before, after, out = (_rms_mm(d) for d in found.distances().values())
    return PositionCalibration(
        arm.name,
        as_face(made),
        tuple(Identified(f.name, f.value, f.unit, f.interval95, f.status) for f in found.findings),
        before,
        after,
        out,
        None if (apart := found.sessions_out) is None else _rms_mm(apart.distance[found.right]),
        None if found.holdout is None else 1e3 * found.holdout[1].rms_m,
        tuple(one.words for one in found.gross),
        found.remarks,
        found,
    )


def read_positions(
    source: str | Path | pd.DataFrame | Sequence[str | Path | pd.DataFrame],
    holdout: str | Path | pd.DataFrame | None,
    arm: Arm,
) -> tuple[AbsoluteReadings, AbsoluteReadings | None]:
    """Tables of positions as one, and what is held out."""
    from doe.absolute.table import joined

    several = list(source) if isinstance(source, Sequence) and not isinstance(source, str) else [source]
    table = joined([_read(one, k, arm) for k, one in enumerate(several, start=1)])
    return table, None if holdout is None else _read(holdout, len(several) + 1, arm)


def _rms_mm(distances: Array) -> float:
    return 1e3 * float(np.sqrt(np.mean(distances**2)))


def _read(source: str | Path | pd.DataFrame, number: int, arm: Arm) -> AbsoluteReadings:
    from doe.absolute.table import absolute_of
    from doe.tables.columns import read_table, table_of_frame

    if isinstance(source, str | Path):
        return absolute_of(read_table(Path(source)), arm.robot)
    return absolute_of(table_of_frame(source, f"data frame {number}"), arm.robot)
