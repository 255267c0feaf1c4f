"""Stiffness of a model at poses spread over its joint ranges, and how much each coordinate matters there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from doe.planning.pose_designs import pose_design
from fem import ArmModel, directional_stiffness
from robots import Robot, forward_kinematics, tool_position
from robots.arrays import Array
from robots.progress import Progress
from surrogate import default_sweep

POSES: Final = 20_000
# Poses at which the other coordinates are kept while one moves, and its values.
KEPT: Final = 1_500
LEVELS: Final = 9
# A coordinate that takes all its values at so many of the settings is free of the others.
FREE: Final = 0.9


@dataclass(frozen=True, eq=False)
class PoseSample:
    """Poses spread evenly over the joint ranges, n of them.

    Parameters
    ----------
    points : (n, 3) m, tool points; joint 1 stands still, because turning about the main axis changes nothing
    stiffness : (n,) N/m
    stretch : (n,) m, distance from the shoulder (joint 2) to the tool point
    """

    points: Array
    stiffness: Array
    stretch: Array

    @property
    def radius(self) -> Array:
        """Distance (n,) m from the base's z axis."""
        return np.asarray(np.hypot(self.points[:, 0], self.points[:, 1]))


@dataclass(frozen=True, eq=False)
class LayerSample:
    """One coordinate moved alone: stiffness (m, k) N/m at m settings of the others, NaN where it cannot be taken."""

    coordinate: str
    levels_deg: Array
    stiffness: Array


@dataclass(frozen=True, eq=False)
class Samples:
    """All that the findings rest on; ``layers``: every swept coordinate moved alone, the layer coordinate first."""

    poses: PoseSample
    layers: tuple[LayerSample, ...]
    layer: str | None


def sample_model(model: ArmModel, n: int = POSES, seed: int = 0, progress: Progress | None = None) -> Samples:
    """Evaluate a model at poses spread by a Sobol sequence over its joint ranges, under a vertical load.

    The coordinates of :func:`surrogate.default_sweep` vary, the others stand at 0 or at the limit nearest to it.

    Raises
    ------
    InputError
        A rigid model, or hardly any pose that can be taken.
    """
    robot = model.robot
    swept, layer = default_sweep(robot)
    varied = ((layer,) if layer else ()) + swept
    rng = np.random.default_rng(seed)
    q = pose_design(robot, n, "sobol", coordinates=varied, rng=rng)
    frames = forward_kinematics(robot, q)
    points = tool_position(robot, frames)
    # frames.p[:, 0] is the base, [:, 2] the body that joint 2 moves: its origin lies on joint 2.
    shoulder = frames.p[:, min(2, robot.dof)]
    poses = PoseSample(points, directional_stiffness(model, q), np.linalg.norm(points - shoulder, axis=1))
    layers = []
    for k, name in enumerate(varied):
        layers.append(_moved_alone(model, q[: min(KEPT, n)], name))
        if progress is not None:
            progress(k + 1, len(varied))
    return Samples(poses, tuple(layers), layer)


def _moved_alone(model: ArmModel, q: Array, name: str) -> LayerSample:
    robot: Robot = model.robot
    j = robot.coordinate_index(name)
    low, high = robot.limits[j]
    # The middles of equal parts: an evenly spread coordinate, without giving its ends extra weight.
    levels = low + (np.arange(LEVELS) + 0.5) / LEVELS * (high - low)
    moved = np.repeat(q[:, None], LEVELS, axis=1)
    moved[..., j] = levels
    flat = moved.reshape(-1, robot.dof)
    reached = robot.reachable(flat)
    stiffness = np.full(len(flat), np.nan)
    if reached.any():
        stiffness[reached] = directional_stiffness(model, flat[reached])
    return LayerSample(name, np.degrees(levels), stiffness.reshape(len(q), LEVELS))


@dataclass(frozen=True)
class Influence:
    """How much a coordinate matters, all of the logarithm of stiffness: variance shares and relative changes.

    ``main``: share of the variance that its mean effect explains; ``total``: share that is lost without it (both as of
    Sobol; Saltelli et al. 2010, doi:10.1016/j.cpc.2009.09.018). ``change_*``: largest over smallest stiffness, less 1,
    when it alone moves: median and 95th percentile over the settings of the others. ``main`` is NaN where a coupling
    ties the coordinate to others: its mean effect would be theirs too, and ``total`` is of the range that it has left.
    """

    main: float
    total: float
    change_median: float
    change_p95: float


def influence(layer: LayerSample, variance: float) -> Influence:
    """Influence of a coordinate; ``variance``: that of the logarithm of stiffness over all poses.

    Settings at which the coordinate cannot take all its values count with those it can.
    """
    logs = np.log(layer.stiffness)
    movable = np.isfinite(logs).sum(axis=1) >= 2
    if not movable.any():
        return Influence(0.0, 0.0, 0.0, 0.0)
    some, count = logs[movable], np.isfinite(logs[movable]).sum(axis=1)
    # The levels are middles of equal parts: of a straight line over m parts they miss 1 / m^2 of the variance.
    within = np.nanvar(some, axis=1) * count**2 / (count**2 - 1)
    whole = logs[np.isfinite(logs).all(axis=1)]
    main = float("nan")
    if len(whole) >= FREE * len(logs):
        main = float(np.var(whole.mean(axis=0))) * whole.shape[1] ** 2 / (whole.shape[1] ** 2 - 1)
    change = np.exp(np.nanmax(some, axis=1) - np.nanmin(some, axis=1)) - 1.0
    median, high = np.percentile(change, [50.0, 95.0])
    return Influence(main / variance, float(within.sum()) / len(logs) / variance, float(median), float(high))


def influences(samples: Samples) -> dict[str, Influence]:
    """Influence of every swept coordinate, by name."""
    variance = float(np.var(np.log(samples.poses.stiffness)))
    return {layer.coordinate: influence(layer, variance) for layer in samples.layers} if variance > 0.0 else {}
