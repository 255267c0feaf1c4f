"""Identification: six stiffnesses at every joint from displacements and twists between neighbouring links."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from robots import InputError
from stiffarm.face.arms import Arm, Picture, as_face
from stiffarm.face.calls import called
from stiffarm.face.readings import Readings
from stiffarm.face.shown import Shown

if TYPE_CHECKING:
    import pandas as pd

    import fem.arm
    from doe.joint_twists import TwistReadings
    from stiffarm.commands.identify.step import JointTwists

# Corner, width and height of the map in the plane Y = 0, mm.
Window = tuple[float, float, float, float]


@dataclass(frozen=True, repr=False)
class Identification(Shown):
    """A finished identification.

    ``arm``: the arm with six springs at every joint, its links rigid; ``remarks``: what the reader must know.
    ``found`` has everything else: the laws, the hysteresis, the checks, the map.
    """

    arm: Arm
    remarks: tuple[str, ...]
    found: JointTwists

    def title(self) -> str:
        """Robot, number of readings, and how many of the stiffnesses are determined."""
        directions = self.found.found.directions.values()
        determined = sum(direction.law is not None for direction in directions)
        made_up = "made-up " if self.found.synthetic else ""
        return (
            f"Identification of {self.arm.name} from {self.found.found.data.n} {made_up}readings: "
            f"{determined} of {len(directions)} stiffnesses determined"
        )

    def to_frame(self) -> pd.DataFrame:
        """One row a joint, direction and angle measured: stiffness in ``unit``, ends of its 95 % interval, status."""
        import pandas as pd

        from stiffarm.commands.identify.payload import stiffness_table

        return pd.read_csv(io.StringIO(stiffness_table(self.found))).drop(columns="data")

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw six compliances of every joint with their 95 % intervals; ``file``: a PNG to write."""
        from stiffarm.commands.identify.figures import compliances_figure

        return Picture.of(compliances_figure(self.found.found)).kept(file)


def identify(
    arm: Arm,
    tables: str | Path | Sequence[str | Path] | None = None,
    *,
    law: Literal["constant", "fourier-1", "fourier-2", "table"] | None = None,
    branches: Literal["mean", "loading"] = "mean",
    holdout: Readings | None = None,
    flange: Literal["forward", "base", "down"] = "forward",
    window_mm: Window | None = None,
    synthetic: bool = False,
    seed: int = 0,
) -> Identification:
    """Identify six stiffnesses per joint from joint twists.

    Joint twists are relative displacements and rotations of the two links of a joint. The links are taken as rigid:
    what they give way by is in the joints' stiffnesses.

    Parameters
    ----------
    arm : the arm before; it is not changed
    tables : tables (CSV/XLSX) of relative displacements and rotations of neighbouring links, or of reflectors
    law : of each stiffness over its joint angle; default: chosen by leaving out one angle at a time
    branches : readings used, "mean" (of loading and unloading) or "loading"
    holdout : flange deflections, used only to test the prediction
    flange : orientation of the flange over the map
    window_mm : of the map in the plane Y = 0: X and Z of its corner, width and height
    synthetic : simulate a measurement campaign for this arm and identify from it, without tables
    seed : of the random numbers

    Raises
    ------
    InputError
        Tables that cannot be read, an arm with effects, or readings that determine no stiffness.

    Examples
    --------
    >>> import stiffarm as sa
    >>> found = sa.identify(sa.load("tx200"), synthetic=True, law="constant")
    >>> sorted(set(found.to_frame()["joint"]))
    ['j1', 'j2', 'j3', 'j4', 'j5', 'j6']
    """
    from stiffarm.commands.identify.report import summary
    from stiffarm.commands.identify.step import Request, run
    from stiffarm.session.inputs import refuse_effects

    if synthetic == (tables is not None):
        raise InputError(
            "tables and synthetic", code="B003", allowed="one of the two", remedy="give tables, or synthetic=True"
        )
    usual = Request()
    corner_and_size = None if window_mm is None else tuple(1e-3 * float(v) for v in window_mm)
    if corner_and_size is not None and (len(corner_and_size) != 4 or not min(corner_and_size[2:]) > 0.0):
        raise InputError(
            "window_mm", code="B003", value=window_mm, allowed="X, Z, width and height in mm, the last two above 0"
        )
    x, z, width, height = corner_and_size or (*usual.origin_m, *usual.size_m)
    with called():
        given = arm.with_links("rigid")
        refuse_effects(given, "identification", "remove the [[effect]] tables: joints are identified anew")
        data = _made_up(given, seed) if tables is None else _read(given, tables)
        found = run(
            given,
            data,
            Request(law, branches, flange, (x, z), (width, height), seed),
            holdout=None if holdout is None else holdout.table,
        )
        made = as_face(Arm.of(found.description, "rigid", arm.model.load_path, arm.own))
    return Identification(made, tuple(summary(found)), found)


def _read(given: fem.arm.Arm, tables: str | Path | Sequence[str | Path]) -> TwistReadings:
    from stiffarm.commands.identify.step import read_tables

    several = [tables] if isinstance(tables, str | Path) else tables
    return read_tables(given, [Path(table) for table in several])


def _made_up(given: fem.arm.Arm, seed: int) -> TwistReadings:
    """Readings of a campaign that nobody has carried out, as read from their table."""
    import tempfile

    from doe.joint_twists import write_twists
    from doe.joint_twists.synthetic import Campaign, draw_truth, make_readings
    from stiffarm.commands.identify.step import read_tables

    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "synthetic_joint_twists.csv"
        write_twists(make_readings(given.model, draw_truth(given.model, rng), Campaign(), rng), path, given.robot)
        return read_tables(given, [path])
