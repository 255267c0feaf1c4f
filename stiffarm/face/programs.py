"""Robot programs: written from a tool path and read back, and verified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from robots import InputError
from stiffarm.face.arms import Arm, Picture
from stiffarm.face.calls import called
from stiffarm.face.shop import Range, setup_of
from stiffarm.face.shown import Shown, frame
from stiffarm.session.table_kinds import PATH, expect

if TYPE_CHECKING:
    import pandas as pd

    from machining.programs.run import PostRun
    from machining.verification.verify import Verification


@dataclass(frozen=True, repr=False)
class Program(Shown):
    """Programs that were written and read back: ``files`` by their names."""

    robot: str
    files: tuple[Path, ...]
    found: PostRun

    def title(self) -> str:
        """Robot, number of moves and of files."""
        return f"Program for {self.robot}: {self.found.program.n} moves, {len(self.files)} files"

    def to_frame(self) -> pd.DataFrame:
        """One row a format: how far the program that was read back is from what was written."""
        trips = self.found.trips
        return frame(
            {
                "format": [target.folder for target in trips],
                "tip_um": [trip.tip * 1e6 for trip in trips.values()],
                "turned_urad": [trip.turned * 1e6 for trip in trips.values()],
            }
        )

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw the joint angles along the program with their limits; ``file``: a PNG to write."""
        from stiffarm.commands.posture.figures.along_path import joints_figure

        program = self.found.program
        steps = np.linalg.norm(np.diff(program.motions.points, axis=0), axis=1)
        way = np.concatenate([[0.0], np.cumsum(steps)])
        return Picture.of(joints_figure(way, {"program": program.q}, self.found.model.robot)).kept(file)


@dataclass(frozen=True, repr=False)
class Checked(Shown):
    """A verified program; ``clean``: whether it may run."""

    robot: str
    found: Verification

    @property
    def clean(self) -> bool:
        """Whether nothing was found that must not happen."""
        return self.found.clean

    def title(self) -> str:
        """Robot, and whether the program may run."""
        errors = len(self.found.errors)
        return f"Verification for {self.robot}: " + ("clean" if self.clean else f"{errors} offences, must not run")

    def to_frame(self) -> pd.DataFrame:
        """One row an offence: line, what it is, where."""
        from stiffarm.commands.verify.payload import offence_rows

        return frame(list(offence_rows(self.found)))

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw how near bodies come to each other in each move; ``file``: a PNG to write."""
        from stiffarm.commands.verify.figures import clearance_figure

        return Picture.of(clearance_figure(self.found)).kept(file)


def post(
    arm: Arm,
    path: str | Path,
    folder: str | Path,
    *,
    cell: str | Path | None = None,
    formats: Sequence[str] = ("json",),
    coordinates: Literal["cartesian", "joint", "both"] = "both",
    gamma_deg: float | Range = 0.0,
    tolerance_um: float = 100.0,
    operations: Sequence[str] = (),
    tool_numbers: Sequence[int] = (),
    at_load_N: float | None = None,
    seed: int = 0,
) -> Program:
    """Write robot programs from a tool path, read them back and compare.

    Parameters
    ----------
    arm : the arm
    path : tool path (APT, CLS, G-code or CSV)
    folder : where the programs go; it must not hold any yet
    cell : cell file; default: the model's tool, the part's frame in the robot's base
    formats : names of program formats, as "krl", "rapid", "val3", "sinumerik", "json"
    coordinates : "cartesian", "joint" or "both"
    gamma_deg : one angle about the tool axis, or first and last angle and step to choose the stiffest from
    tolerance_um : allowed deviation of joint motion from a straight line between points
    operations, tool_numbers : of the tool path, take these only; default: all
    at_load_N : load at which stiffness is stated, for an arm with effects; default: as of :func:`stiffarm.map_joints`
    seed : of the random numbers

    Raises
    ------
    InputError
        A point out of reach, an unknown format, a folder that is not empty, or a program that does not read back.
    """
    from machining import Drive, GammaRange, Objective
    from machining.cutting import stiffness_uncertainty
    from machining.programs.posting import PostSettings
    from machining.programs.run import PostRequest, run_post
    from machining.programs.write_options import WriteOptions
    from machining.toolpaths import read_toolpath
    from machining.toolpaths.selection import select
    from stiffarm.commands.post.targets import parse_targets
    from stiffarm.session.stated import at_load

    place = Path(folder)
    if place.exists() and (not place.is_dir() or any(place.iterdir())):
        raise InputError(
            "folder", code="F009", value=str(place), allowed="a new or empty folder", remedy="choose another name"
        )
    with called():
        arm = at_load(arm, at_load_N)
        targets = parse_targets(",".join(formats), coordinates)
        expect(Path(path), PATH)
        setup = setup_of(arm, cell)
        motions = select(read_toolpath(Path(path)), operations=operations, tool_numbers=tool_numbers)
        axes = len(setup.cell.linear_axes)
        settings = PostSettings(
            gamma=float(np.radians(gamma_deg))
            if isinstance(gamma_deg, int | float)
            else GammaRange.of_degrees(*gamma_deg),
            objective=Objective(),
            drive=setup.drive(Drive(), clear=False),
            travel=np.zeros(axes) if axes else None,
            tolerance=tolerance_um * 1e-6,
            seed=seed,
            clearance=setup.clearance(motions),
        )
        stiffness = stiffness_uncertainty(arm.model.as_designed, arm.description, arm.own)
        request = PostRequest(motions, setup, settings, targets, WriteOptions(), stiffness=stiffness)
        files: list[Path] = []

        def path_of(name: str) -> Path:
            files.append(place / name)
            files[-1].parent.mkdir(parents=True, exist_ok=True)
            return files[-1]

        found = run_post(arm.model, request, path_of)
    return Program(arm.name, tuple(files), found)


def verify(arm: Arm, program: str | Path, cell: str | Path) -> Checked:
    """Check a neutral program (JSON) for collisions, limits, speeds, singularities and deviations from the path.

    Parameters
    ----------
    arm : the arm
    program : part.json of the format "json"
    cell : cell file

    Raises
    ------
    InputError
        A program of another arm or cell, or one that cannot be read.
    """
    from machining.cell import arm_bodies, read_cell
    from machining.programs.formats import read_program
    from machining.verification import Demands, verify

    with called():
        described = read_cell(Path(cell))
        bodies = arm_bodies(arm.as_designed.description, beam_radius=described.beam_radius)
        given = read_program(Path(program), bodies.robot, described)
        return Checked(arm.name, verify(given, bodies, Demands()))
