"""How far any two bodies can move against each other while the axes move: the bound behind continuous checks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from machining.cell import Scene
from machining.verification.courses import MovingAxes
from robots import forward_kinematics
from robots.arrays import Array, Bools, Integers

# Added to distances from axes, m: they are differences of squares.
ROUNDING = 1e-6
CHUNK = 1024


@dataclass(frozen=True, eq=False)
class MotionBound:
    """Bound on relative motion in a scene; made by :func:`motion_bound`.

    ``corners`` (s, 8, 3) m: boxes around the arm's moving solids, in the frames ``frame`` (s,) they move with.
    ``moves`` (s, dof): whether a joint moves a solid. ``lever`` (s, dof) m: constant distance where a joint turns a
    solid about a point of the arm (crank and bar of a parallelogram), NaN where it turns it about its own axis.
    ``table_reach`` m: farthest point from the turntable's axis of what it carries.
    """

    scene: Scene
    axes: MovingAxes
    corners: Array
    frame: Integers
    moves: Bools
    lever: Array
    table_reach: float

    def __call__(self, start: Array, way: Array) -> Array:
        """Most (m,) m that any two bodies move against each other.

        While axis j goes the way ``way[:, j]``, a point at a distance r_j from it goes at most ``way_j max r_j``. On
        the way r_j grows by no more than the joints behind j move the point, so the bounds follow one another from
        the flange inward. Linear axes add their ways, the turntable its angle times its reach.

        Parameters
        ----------
        start : (m, a) coordinates at one end
        way : (m, a) how far each axis moves from there, to and fro added up, 0 or more
        """
        rows = range(0, len(start), CHUNK)
        parts = [self.solids(start[i : i + CHUNK], way[i : i + CHUNK]).max(axis=1, initial=0.0) for i in rows]
        dof, k = self.axes.dof, self.axes.travels
        bound = np.concatenate(parts) if parts else np.zeros(0)
        bound += way[:, dof : dof + k].sum(axis=1)
        if self.axes.count > dof + k:
            bound += way[:, -1] * self.table_reach
        return np.asarray(bound)

    def solids(self, start: Array, way: Array) -> Array:
        """Most (m, s) m that any point of each moving solid of the arm goes, as seen from the base."""
        q, way = start[:, : self.axes.dof], way[:, : self.axes.dof]
        R, p = self.scene.arm.frames(q)
        x = np.einsum("nsij,scj->nsci", R[:, self.frame], self.corners) + p[:, self.frame][:, :, None]
        kinematics = forward_kinematics(self.scene.arm.robot, q)
        axis, origin = np.ascontiguousarray(kinematics.axis), kinematics.p[:, 1:]
        total = np.zeros((len(q), len(self.frame)))
        for j in range(self.axes.dof - 1, -1, -1):
            r = x - origin[:, j, None, None]
            along = np.einsum("nsci,ni->nsc", r, axis[:, j])
            away = np.einsum("nsci,nsci->nsc", r, r) - along**2
            reach = np.sqrt(np.maximum(away, 0.0).max(axis=2)) + ROUNDING
            reach = np.where(np.isnan(self.lever[:, j]), reach, self.lever[:, j])
            total += self.moves[:, j] * way[:, j, None] * (reach + total)
        return total


def motion_bound(scene: Scene, axes: MovingAxes) -> MotionBound:
    """Bound for a scene; the arm's bodies are taken as the boxes around their solids."""
    arm, robot = scene.arm, scene.arm.robot
    signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    box = scene.bounds
    corners = box.middle[:, None] + np.einsum("sij,sj,cj->sci", box.R, box.half, signs)
    frame = scene.solid_frames
    moved = (frame > 0) & (frame < arm.count)
    joints = np.arange(robot.dof)
    moves = joints < frame[moved, None]
    lever = np.full(moves.shape, np.nan)
    para = robot.parallelogram
    if para is not None:
        # The crank turns with the driven joint's body about a point of another; the bar goes along without turning.
        own, driven = para.crank_about + 1, para.driven + 1
        for row, number in enumerate(frame[moved]):
            if number > arm.flange:
                moves[row] = joints < driven
                swung = (joints >= own) & (joints < driven)
                crank = number == arm.flange + 1
                far = np.linalg.norm(corners[moved][row], axis=1).max() if crank else np.linalg.norm(para.pin)
                lever[row, swung] = float(far)
    table_reach = 0.0
    table = scene.cell.turntable
    carried = np.flatnonzero(frame == arm.count + 1)
    if table is not None and len(carried):
        r = corners[carried].reshape(-1, 3) - table.point
        table_reach = float(np.linalg.norm(np.cross(r, table.axis), axis=1).max())
    return MotionBound(scene, axes, corners[moved], frame[moved], moves, lever, table_reach)
