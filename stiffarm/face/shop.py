"""The shop floor: posture along a path, and placement of the base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from robots import InputError
from stiffarm.face.arms import Arm, Picture
from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame
from stiffarm.session.table_kinds import PATH, expect

if TYPE_CHECKING:
    import pandas as pd

    from machining.cutting.milling_file import Cut
    from machining.placement.study import PlacedStep
    from machining.posture.posing import Posed
    from machining.setup import Setup

# First value, last value and step.
Range = tuple[float, float, float]
Axes = Literal["base", "part", "process"]
Aim = Literal["ksf", "mean", "worst", "error"]
Mode = Literal["fixed", "steps", "moving"]


@dataclass(frozen=True, repr=False)
class Posture(Shown):
    """The posture along a path; ``gain``: how much stiffer it is than the best fixed gamma, with its 95 % interval."""

    robot: str
    gain: tuple[float, float, float] | None
    found: Posed

    def title(self) -> str:
        """Robot, number of points, and the gain over the best fixed gamma."""
        gain = "" if self.gain is None else "; {:.4g} times the best fixed gamma ({:.4g} to {:.4g})".format(*self.gain)
        return f"Posture of {self.robot} along {self.found.request.task.path.n} points{gain}"

    def to_frame(self) -> pd.DataFrame:
        """One row a point: gamma, joint angles in degrees, the index, distances to limits and singularities."""
        from stiffarm.commands.posture.payload import columns

        return frame(columns(self.found))

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw the joint angles along the path, the recommended course and others, with limits; ``file``: a PNG."""
        from machining.posture.posing import CHOSEN
        from stiffarm.commands.posture.figures.along_path import joints_figure

        f = self.found
        courses = {CHOSEN: f.course.q} | {name: course.q for name, course in f.others.items()}
        return Picture.of(joints_figure(f.request.task.path.arc_length, courses, f.model.robot)).kept(file)


@dataclass(frozen=True, repr=False)
class Placement(Shown):
    """Where the base should stand; ``save`` writes what :func:`stiffarm.post` follows."""

    robot: str
    found: PlacedStep

    def title(self) -> str:
        """Robot and number of points."""
        return f"Placement of {self.robot} for {self.found.given.path.n} points"

    def to_frame(self) -> pd.DataFrame:
        """One row a point: where the axes and joints stand, and how stiff the arm is there."""
        from stiffarm.commands.place.payload import columns

        return frame(columns(self.found))

    def plot(self, file: str | Path | None = None) -> Picture:
        """Draw stiffness and surface error along the path, before and after; ``file``: a PNG to write."""
        from stiffarm.commands.place.figures import along_figure
        from stiffarm.commands.place.payload import named

        return Picture.of(along_figure(named(self.found))).kept(file)


def posture(
    arm: Arm,
    path: str | Path,
    *,
    cell: str | Path | None = None,
    gamma_deg: Range = (-180.0, 180.0, 5.0),
    quantity: str | None = None,
    aim: Literal["mean", "worst"] = "mean",
    force_N: Sequence[float] | None = None,
    milling: str | Path | None = None,
    operations: Sequence[str] = (),
    tool_numbers: Sequence[int] = (),
    at_load_N: float | None = None,
    seed: int = 0,
) -> Posture:
    """Find the stiffest posture along a tool path that can be driven: gamma, branch and turns of the joints.

    Parameters
    ----------
    arm : the arm; where it was calibrated, intervals rest on the calibration's covariance
    path : tool path (APT, CLS, G-code or CSV)
    cell : cell file; default: the model's tool, the part's frame in the robot's base
    gamma_deg : first and last angle about the tool axis, and step
    quantity : index to optimise; default: k_fs, or "room" for an arm without springs
    aim : the mean over the points, or the worst point
    force_N : on the tool, base axes; ``milling``: a milling file instead
    operations, tool_numbers : of the tool path, take these only; default: all
    at_load_N : load at which stiffness is stated, for an arm with effects; default: as of :func:`stiffarm.map_joints`

    Raises
    ------
    InputError
        A point out of reach, a model in which nothing deflects, or a path that cannot be read.
    """
    from machining import Drive, GammaRange, Objective
    from machining.cutting import stiffness_uncertainty
    from machining.posture.posing import FIXED, PostureRequest, pose_along
    from machining.programs.run import deflects
    from machining.stiffness.objective import ROOM
    from machining.tool_cuts import cut_of_tools
    from machining.toolpaths import read_given_path
    from stiffarm.session.softness import require_springs
    from stiffarm.session.stated import at_load
    from stiffarm.session.task_setup import effects_left_out

    with called():
        arm = at_load(arm.as_designed, at_load_N)
        springless = not deflects(arm.model)
        if springless and (force_N is not None or milling is not None or quantity not in (None, ROOM)):
            require_springs(arm, "posture")
        quantity = quantity or (ROOM if springless else "k_fs")
        setup, cut = setup_of(arm, cell), _cut(force_N, "base", milling)
        expect(Path(path), PATH)
        given = read_given_path(Path(path), operations=operations, tool_numbers=tool_numbers)
        task = setup.task(given)
        if cut is None and given.motions is not None and not springless:
            cut = cut_of_tools(setup.cell, given.motions)
        if cut is not None:
            cut = replace(cut, force=given.acting(cut.force), tool=given.bending(cut.tool))
        request = PostureRequest(
            task,
            Objective(quantity, None if cut is None else cut.force.along(task).force, aim),
            GammaRange.of_degrees(*gamma_deg),
            setup.drive(Drive(), given=given),
            seed=seed,
            cut=cut,
            left_out=tuple(effects_left_out(arm)),
            stiffness=stiffness_uncertainty(arm.model, arm.description, arm.own),
        )
        found = pose_along(arm.model, request)
    gain = found.gain(FIXED) if FIXED in found.others else None
    return Posture(arm.name, None if gain is None else (gain.value, gain.low, gain.high), found)


def place(
    arm: Arm,
    path: str | Path,
    cell: str | Path,
    *,
    force_N: Sequence[float] | None = None,
    force_axes: Axes = "part",
    milling: str | Path | None = None,
    aim: Aim = "error",
    mode: Mode = "fixed",
    gamma_deg: Range = (-180.0, 180.0, 10.0),
    collisions: bool = True,
    operations: Sequence[str] = (),
    tool_numbers: Sequence[int] = (),
    at_load_N: float | None = None,
) -> Placement:
    """Find where the base should stand, or how it should move, on the cell's linear axes for the stiffest cut.

    Parameters
    ----------
    arm : the arm; where it was calibrated, intervals rest on the calibration's covariance
    path : tool path (APT, CLS, G-code or CSV)
    cell : cell file with the linear axes
    force_N, force_axes : cutting force on the tool; ``milling``: a milling file instead; one of the two is needed
    aim : "error" (of the surface, under the force), "ksf" (the criterion K_sf), "mean" or "worst"
    mode : "fixed", "steps" or "moving"
    gamma_deg : first and last angle about the tool axis, and step
    collisions : keep the arm clear of the cell
    operations, tool_numbers : of the tool path, take these only; default: all
    at_load_N : load at which stiffness is stated, for an arm with effects; default: as of :func:`stiffarm.map_joints`

    Raises
    ------
    InputError
        No position from which the whole path can be reached, or a cell without linear axes.
    """
    from machining import Drive, GammaRange
    from machining.cell import arm_bodies, read_cell, scene_of
    from machining.cutting import stiffness_uncertainty
    from machining.placement import Goal, How, Problem, space_of
    from machining.placement.study import place_along
    from machining.setup import Setup
    from machining.tooling import require_tools
    from machining.toolpaths import read_given_path
    from stiffarm.session.softness import require_springs
    from stiffarm.session.stated import at_load

    with called():
        arm = at_load(arm.as_designed, at_load_N)
        require_springs(arm, "placement")
        cut = _cut(force_N, force_axes, milling)
        if cut is None:
            raise InputError(
                "place needs a cutting force", code="K004", allowed="force_N or milling", remedy="give one of the two"
            )
        described = read_cell(Path(cell))
        expect(Path(path), PATH)
        given = read_given_path(Path(path), operations=operations, tool_numbers=tool_numbers)
        require_tools(described, given.motions)
        scene = (
            scene_of(described, arm_bodies(arm.description, beam_radius=described.beam_radius)) if collisions else None
        )
        problem = Problem(
            model=arm.model,
            space=space_of(described),
            path=given.path,
            goal=Goal(aim, given.drilling(cut.force)),
            gamma=GammaRange.of_degrees(*gamma_deg),
            drive=Drive(speed=described.joint_speed),
            scene=scene,
            clearance=described.safety,
            free=given.free,
            stiffness=stiffness_uncertainty(arm.model, arm.description, arm.own),
            tools=Setup(described, None if scene is None else scene.arm).tools(given),
        )
        found = place_along(problem, given, How(mode), () if scene is None else scene.notes, mapped=False)
    return Placement(arm.name, found)


def setup_of(arm: Arm, cell: str | Path | None) -> Setup:
    """The cell of a file, or the model's tool, the part's frame in the base, and the plane that the arm stands on."""
    from machining.cell import Cell, Tool, arm_bodies, read_cell
    from machining.setup import Setup

    if cell is None:
        found = Cell(T_world_part0=np.eye(4), tool=Tool(arm.robot.T_flange_tool), stands=True)
    else:
        found = read_cell(Path(cell))
    return Setup(found, arm_bodies(arm.description, beam_radius=found.beam_radius))


def _cut(force_N: Sequence[float] | None, axes: Axes, milling: str | Path | None) -> Cut | None:
    from machining.cutting import ConstantForce, read_milling
    from machining.cutting.milling_file import Cut

    if force_N is not None and milling is not None:
        raise InputError("force_N and milling", code="K004", value="both", allowed="one of the two")
    if milling is not None:
        return read_milling(Path(milling))
    return None if force_N is None else Cut(ConstantForce(np.array(force_N, dtype=np.float64), axes))
