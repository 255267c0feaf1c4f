"""Where in the cell an offence is: pose, place, the bodies it is about, and their distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from machining.cell.scene import ARM, CARRIAGE, CUTTER, HOLDER
from machining.verification import Contact, Kind, Offence, Verification, contact_of
from machining.verification.contacts import POSES
from robots import forward_kinematics
from robots.arrays import Array
from stiffarm.commands.verify.words import UNITS

OVERLAPS = (Kind.COLLISION, Kind.RAPID_CONTACT)


@dataclass(frozen=True)
class Spot:
    """An offence at its worst.

    Attributes
    ----------
    offence, contact : what, and where its two bodies are nearest; None where it is not about two bodies
    values, move, line : pose (a,) that is shown, its move and line
    place : (3,) m in the world: between the bodies, at the joint beyond its limit, else at the tip
    bodies : names of the bodies that it is about: the two, what the joint moves, or the cutter
    """

    offence: Offence
    contact: Contact | None
    values: Array
    move: int
    line: int
    place: Array
    bodies: tuple[str, ...]

    @property
    def distance_words(self) -> str:
        """How far apart the bodies are, or how far they reach into each other; empty without two bodies."""
        if self.contact is None:
            return ""
        gap = self.contact.gap
        if gap < 0.0:
            return f"{UNITS['m'].text(-gap, unit=True)} into each other"
        # One body within the other's surface: no distance is worked out there.
        return "overlap" if self.offence.kind in OVERLAPS else f"{UNITS['m'].text(gap, unit=True)} apart"


def spot_of(found: Verification, offence: Offence, poses: int = POSES) -> Spot:
    """Where an offence is worst, of so many poses, and what it is about there."""
    contact = contact_of(found, offence, poses)
    if contact is not None and offence.bodies is not None:
        place = contact.points.mean(axis=0)
        return Spot(offence, contact, contact.values, contact.move, contact.line, place, offence.bodies)
    values, line = offence.worst_values, int(found.program.motions.line[offence.worst])
    names = found.axes.names
    axis = names.index(offence.axis) if offence.axis in names else -1
    place, bodies = _of_axis(found, offence, axis) if axis >= 0 else _of_tool(found, offence)
    return Spot(offence, None, values, offence.worst, line, place, bodies)


def _of_axis(found: Verification, offence: Offence, axis: int) -> tuple[Array, tuple[str, ...]]:
    """The joint's origin and the body that it moves; of a linear axis the foot and what carries it."""
    program, dof, scene = found.program, found.axes.dof, found.scene_at(offence.worst)
    q, travel, _ = found.axes.parts(offence.worst_values[None])
    base = program.cell.T_world_base(travel)[0]
    if axis < dof:
        origin = forward_kinematics(program.robot, q).p[0, axis + 1]
        moved = [m.body.name for m in scene.members if m.kind == ARM and m.frame == axis + 1]
        # The last joint's link may have no shape of its own: what it turns is the tool.
        moved = moved or [m.body.name for m in scene.members if m.kind in (HOLDER, CUTTER)]
        return base[:3, :3] @ origin + base[:3, 3], tuple(moved[:1])
    carried = [m.body.name for m in scene.members if m.kind == CARRIAGE or (m.kind == ARM and m.frame == 0)]
    return base[:3, 3], tuple(carried[-1:]) if axis < dof + found.axes.travels else ()


def _of_tool(found: Verification, offence: Offence) -> tuple[Array, tuple[str, ...]]:
    """The tip and the cutter."""
    values = offence.worst_values[None]
    table = found.axes.parts(values)[2]
    tip = found.program.cell.T_world_part(table)[0] @ found.courses.frames(values, np.array([offence.worst]))[0]
    cutters = [m.body.name for m in found.scene_at(offence.worst).members if m.kind == CUTTER]
    return np.asarray(tip[:3, 3]), tuple(cutters[:1])
