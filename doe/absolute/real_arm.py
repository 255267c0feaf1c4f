"""Where the tool of a calibrated arm really is: geometry, joint errors, and what gives way under its own weight.

It is the model of the calibration (:mod:`doe.absolute.chain`) with the figures of a model file. Springs that vary with
the pose are left out of the sag, as they are in a calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from doe.absolute.chain import BLOCK, Nominal, Sample, evaluate, frame_errors, posed, samples, turning
from doe.absolute.known import known
from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.absolute.unknowns import Layout, Unknown, single, targets
from doe.absolute.weight import AXIAL
from fem import ArmModel
from fem.springs import ConstantSpring
from robots.arrays import Array, Integers, in_blocks
from robots.frames import by_frame

# Points beside the tool's origin, by whose positions its axes are known, m.
ARM_m = 0.1
NOTHING = Payload(0.0, np.zeros(3))


@dataclass(frozen=True, eq=False)
class RealArm:
    """A calibrated arm and what its flange carries."""

    model: ArmModel
    payload: Payload = field(default_factory=lambda: NOTHING)

    @property
    def rigid(self) -> RealArm:
        """The same arm without springs: its geometry alone."""
        none = np.zeros((6, 6))
        return RealArm(replace(self.model.with_rigid_joints(), base=none), self.payload)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Joints whose springs vary with the pose: their sag is not in it."""
        return tuple(
            joint.name for joint in self.model.joints if joint.laws or not isinstance(joint.axial, ConstantSpring)
        )

    def frames(self, q: Array, T_flange_tool: Array) -> tuple[Array, Array]:
        """Axes (n, 3, 3) and origin (n, 3) m of the tool in the base frame at coordinates q (n, dof) rad.

        ``T_flange_tool`` (4, 4) m, or (n, 4, 4) where tools are changed.
        """
        if T_flange_tool.ndim == 3:
            return _tool_by_tool(self.frames, q, T_flange_tool)
        if self._only_turns:
            return self._turned(q, T_flange_tool)
        points = _points_of(T_flange_tool)
        P = np.concatenate([self._points(q[rows], points) for rows in in_blocks(len(q), BLOCK)], axis=1)
        A = np.moveaxis((P[1:] - P[0]) / ARM_m, 0, -1)
        # Small displacements turn the axes by first order: the nearest rotation is a step away.
        return np.asarray(1.5 * A - 0.5 * A @ np.swapaxes(A, 1, 2) @ A), P[0]

    @property
    def _only_turns(self) -> bool:
        """Whether weight does nothing but turn joints about their axes, so that one pose of the arm says all."""
        about_axes = all(one.index[1] == AXIAL and one.index[0] >= 0 for one in self._known if one.kind == "spring")
        return about_axes and self.model.bar is None

    def _turned(self, q: Array, T_flange_tool: Array) -> tuple[Array, Array]:
        R, p = np.empty((len(q), 3, 3)), np.empty((len(q), 3))
        tip = T_flange_tool[None, :3, 3]
        layout, u = self._layout(tip)
        errors = frame_errors(layout, self.model.robot.dof, u)
        for rows in in_blocks(len(q), BLOCK):
            for s in self._samples(q[rows], tip, layout, u):
                at = posed(self.model, turning(layout, s, u).angle, errors)
                flange = np.moveaxis(at.R, -1, 0)
                R[rows], p[rows] = flange @ T_flange_tool[:3, :3], at.p.T + flange @ tip[0]
        return R, p

    def angles(self, q: Array) -> Array:
        """What joints really turn (n, dof) rad at coordinates q (n, dof) rad, sag and all; zeros are the robot's."""
        out = np.empty_like(np.asarray(q, dtype=np.float64))
        for rows in in_blocks(len(q), BLOCK):
            layout, u = self._layout(np.zeros((1, 3)))
            for s in self._samples(q[rows], np.zeros((1, 3)), layout, u):
                out[rows] = turning(layout, s, u).angle.T
        return out

    def doubt(self, q: Array, T_flange_tool: Array) -> tuple[Array, Array]:
        """Standard deviations of the tool's place (n,) m and turn (n,) rad, all directions together.

        By what the calibration left open of everything but error curves; zero where the model does not say. Tools as in
        :meth:`frames`.
        """
        if T_flange_tool.ndim == 3:
            return _tool_by_tool(self.doubt, q, T_flange_tool)
        errors = self.model.robot.errors
        free = [] if errors is None else [(k, single(self.model.robot, n)) for k, n in enumerate(errors.parameters)]
        rows = [k for k, one in free if one is not None]
        if errors is None or not rows:
            return np.zeros(len(q)), np.zeros(len(q))
        points = _points_of(T_flange_tool)
        there = {one.name: v for one, v in self._known.items()}
        mine = [one for _, one in free if one is not None]
        names = {one.name for one in mine}
        whole, u = self._layout(points)
        rest = [k for k, one in enumerate(whole.unknowns) if one.name not in names]
        layout = Layout((*mine, *(whole.unknowns[k] for k in rest)))
        u = np.array([*(there.get(one.name, 0.0) for one in mine), *u[rest]])
        half = _root(errors.covariance[np.ix_(rows, rows)])
        place, turn = [], []
        for some in in_blocks(len(q), BLOCK // 4):
            J = [evaluate(self.model, layout, s, u)[1][: len(mine)] for s in self._samples(q[some], points, layout, u)]
            moved = np.tensordot(half.T, np.concatenate(J, axis=2), 1).reshape(len(half), 3, len(points), -1)
            place.append(np.sqrt(np.sum(moved[:, :, 0] ** 2, axis=(0, 1))))
            axes = (moved[:, :, 1:] - moved[:, :, :1]) / ARM_m
            R = self.frames(q[some], T_flange_tool)[0]
            w = 0.5 * sum(np.cross(R[:, :, a], np.moveaxis(axes[:, :, a], 1, -1)) for a in range(3))
            turn.append(np.sqrt(np.sum(np.asarray(w) ** 2, axis=(0, 2))))
        return np.concatenate(place), np.concatenate(turn)

    def _points(self, q: Array, points: Array) -> Array:
        layout, u = self._layout(points)
        P = [evaluate(self.model, layout, s, u, slopes=False)[0] for s in self._samples(q, points, layout, u)]
        return np.asarray(np.concatenate(P, axis=1).T.reshape(len(points), len(q), 3))

    def _samples(self, q: Array, points: Array, layout: Layout, u: Array) -> Iterator[Sample]:
        k, n = len(points), len(q)
        yield from samples(
            self.model,
            self._readings(np.tile(q, (k, 1)), np.repeat(np.arange(k), n)),
            layout,
            Nominal(points, (0.0, 0.0)),
            u,
        )

    def _layout(self, points: Array) -> tuple[Layout, Array]:
        data = self._readings(np.zeros((len(points), self.model.robot.dof)), np.arange(len(points)))
        there = self._known
        return Layout((*there, *targets(data))), np.array([*there.values(), *points.reshape(-1)])

    @cached_property
    def _known(self) -> dict[Unknown, float]:
        return known(self.model, ())

    def _readings(self, q: Array, point: Integers) -> AbsoluteReadings:
        n, none = len(q), np.zeros(len(q), dtype=np.int64)
        labels = Labels(tuple(map(str, range(int(point.max(initial=0)) + 1))), point.astype(np.int64))
        return AbsoluteReadings(
            "",
            "",
            q,
            np.zeros((n, 3)),
            Labels(("",), none),
            labels,
            none,
            (self.payload,),
            np.zeros(n),
            np.full(n, np.nan),
            none,
        )


def _tool_by_tool(of: Callable[[Array, Array], tuple[Array, Array]], q: Array, T: Array) -> tuple[Array, Array]:
    """Two arrays over poses q (n, dof) rad, worked out with one tool after the other; T (n, 4, 4) m."""
    parts = [(rows, of(q[rows], one)) for rows, one in by_frame(T, len(q))]
    order = np.argsort(np.concatenate([rows for rows, _ in parts]))
    first, second = (np.concatenate([found[i] for _, found in parts])[order] for i in range(2))
    return first, second


def _points_of(T_flange_tool: Array) -> Array:
    """The tool's origin and a point along each of its axes (4, 3) m in the flange frame."""
    return np.asarray(T_flange_tool[:3, 3] + np.vstack([np.zeros(3), ARM_m * T_flange_tool[:3, :3].T]))


def _root(V: Array) -> Array:
    """H (p, p) with V = H H^T."""
    size = np.sqrt(np.maximum(np.diag(V), 1e-300))
    values, vectors = np.linalg.eigh(V / np.outer(size, size))
    return np.asarray(size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
