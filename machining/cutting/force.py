"""Cutting force along a path, linear in a few uncertain parameters: force components, or cutting coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from machining.cutting.coefficients import NAMES, CuttingCoefficients, PlungeCoefficients
from machining.cutting.end_mill import (
    EndMill,
    Engagement,
    generating_matrix,
    immersion,
    mean_matrix,
    mean_torque,
    peak_forces,
)
from machining.cutting.process_axes import ProcessAxes, process_axes
from machining.task import Task
from robots import InputError, require_at_least, require_one_of
from robots.arrays import Array, Bools

Axes = Literal["base", "part", "process"]
Instant = Literal["mean", "generating"]

# Assumed standard deviation of force components and of cutting coefficients, share of the value.
ASSUMED_SD = 0.10
# Half of a 95 % interval over the standard deviation; and what is said of coefficients out of a publication.
NORMAL_95 = 1.959964
NOT_MEASURED = "published values, not measured on this machine and material"
# Heights at which the force that makes the wall is averaged; 64 leave 1e-3 of it or less.
SLICES = 64
# Cosine of the angle between surface normal and wall beyond which the surface is not the mill's wall.
SAME_NORMAL = np.cos(np.radians(1.0))


@dataclass(frozen=True, eq=False)
class ForceAlong:
    """Force on the tool at n points, ``sum_k value_k basis_k``.

    ``basis`` (n, k, 3): N, base axes, for one unit of each parameter; ``value`` (k,), ``covariance`` (k, k) of the
    parameters; ``names`` (k,); ``note``: what the uncertainty rests on.
    """

    basis: Array
    value: Array
    covariance: Array
    names: tuple[str, ...]
    note: str

    @property
    def force(self) -> Array:
        """Force (n, 3) N, base axes."""
        return np.asarray(np.einsum("k,nki->ni", self.value, self.basis))


class CuttingForce(Protocol):
    """What :func:`machining.cutting.surface_error` takes for a force."""

    def along(self, task: Task) -> ForceAlong:
        """The force on the tool along a task's path."""
        ...


@dataclass(frozen=True, eq=False)
class ConstantForce:
    """One force on the tool all along the path.

    ``components`` (3,) N in ``axes``: "base", "part" or "process" (feed, cross-feed, tool axis;
    :mod:`machining.cutting.process_axes`). ``relative_sd``: standard deviation of each component as a share of it, the
    components independent; one that is zero is taken as exactly zero. ``covariance`` (3, 3) N^2 in the same axes
    instead.

    Raises
    ------
    InputError
        Components that are not finite or all zero, unknown axes, a negative or infinite uncertainty, or a matrix that
        is no covariance.
    """

    components: Array
    axes: Axes = "base"
    relative_sd: float = ASSUMED_SD
    covariance: Array | None = None

    def __post_init__(self) -> None:
        value = np.asarray(self.components, dtype=np.float64)
        if value.shape != (3,) or not np.isfinite(value).all() or not value.any():
            raise InputError(
                "cutting force", code="K005", value=value.tolist(), allowed="3 finite numbers, not all zero: N"
            )
        require_one_of("axes of the cutting force", self.axes, ("base", "part", "process"), code="K005")
        object.__setattr__(self, "components", value)
        require_at_least("relative standard deviation of the force", self.relative_sd, 0.0, code="K005")
        if self.covariance is not None:
            object.__setattr__(self, "covariance", as_covariance("covariance of the force", self.covariance, 3))

    def along(self, task: Task) -> ForceAlong:
        """See :class:`CuttingForce`. Raises InputError for process axes where the path has no feed direction."""
        if self.axes == "process":
            columns = process_axes(task).columns
        else:
            R = task.T_base_part[:3, :3] if self.axes == "part" else np.eye(3)
            columns = np.broadcast_to(R, (task.path.n, 3, 3))
        names = tuple(f"F_{n}" for n in (("feed", "cross", "axis") if self.axes == "process" else "xyz"))
        covariance, note = _covariance(self.components, self.relative_sd, self.covariance, "force components")
        return ForceAlong(np.swapaxes(columns, 1, 2), self.components, covariance, names, note)


@dataclass(frozen=True, eq=False)
class MillingForce:
    """Force of an end mill by the mechanistic model (:mod:`machining.cutting.end_mill`).

    ``instant``: "mean", the mean over a revolution. It is what a robot arm follows, whose first natural frequencies
    (some 10 Hz) lie far below that of the teeth. "generating": the force while a tooth makes the wall, the static
    form error of a tool that follows at once; at ``height`` m above the tip, or the mean over the axial depth.
    ``feed_per_tooth`` m, or None: from the path's feed and ``spindle_speed`` rad/s. ``relative_sd`` of each
    coefficient, independent, or ``covariance`` (6, 6) SI. The force acts at the tool point, not up the flutes.
    ``plunge``: coefficients of the end teeth, None: what acts on a tool that plunges is not known, and left out.

    Raises
    ------
    InputError
        Feed per tooth and spindle speed both or neither given, or not positive; "generating" without a wall or with
        a height off the cut; a negative uncertainty, or a matrix that is no covariance.
    """

    mill: EndMill
    engagement: Engagement
    coefficients: CuttingCoefficients
    instant: Instant = "mean"
    feed_per_tooth: float | None = None
    spindle_speed: float | None = None
    height: float | None = None
    relative_sd: float = ASSUMED_SD
    covariance: Array | None = None
    plunge: PlungeCoefficients | None = None

    def __post_init__(self) -> None:
        given = [v for v in (self.feed_per_tooth, self.spindle_speed) if v is not None]
        if len(given) != 1 or not 0.0 < given[0] < np.inf:
            raise InputError(
                "feed per tooth or spindle speed",
                code="K005",
                value=f"{self.feed_per_tooth} m, {self.spindle_speed} rad/s",
                allowed="one of them, finite and more than 0",
                remedy="with a spindle speed the feed is taken from the path",
            )
        require_one_of("instant of the milling force", self.instant, ("mean", "generating"), code="K005")
        if self.instant == "generating" and self.engagement.wall is None:
            raise InputError(
                "force that makes the wall: the engagement leaves none", code="K005", allowed="wall 'left' or 'right'"
            )
        if self.height is not None and not 0.0 <= self.height <= self.engagement.axial_depth:
            raise InputError(
                "height on the wall",
                code="K005",
                value=self.height,
                allowed=f"0 to {self.engagement.axial_depth:g} m above the tip",
            )
        require_at_least("relative standard deviation of the force", self.relative_sd, 0.0, code="K005")
        if self.covariance is not None:
            object.__setattr__(self, "covariance", as_covariance("covariance of the coefficients", self.covariance, 6))

    def chip(self, task: Task) -> Array:
        """Feed per tooth (n,) m along the path; the first point takes that of the second.

        Raises
        ------
        InputError
            It is to come from the path's feed, and that is missing somewhere.
        """
        n = task.path.n
        if self.feed_per_tooth is not None:
            return np.full(n, self.feed_per_tooth)
        assert self.spindle_speed is not None  # noqa: S101 - checked when made
        feed = task.path.feed.copy()
        feed[0] = feed[min(1, n - 1)]
        if np.isnan(feed).any():
            raise InputError(
                f"feed at path point {int(np.argmax(np.isnan(feed)))}",
                code="K007",
                value="not given",
                allowed="more than 0 m/s at every point after the first",
                remedy="give the path a feed, or the force a feed per tooth",
            )
        return np.asarray(feed * 2.0 * np.pi / (self.spindle_speed * self.mill.teeth))

    def along(self, task: Task) -> ForceAlong:
        """See :class:`CuttingForce`.

        Raises
        ------
        InputError
            No feed direction or feed; for "generating", surface normals that are not those of the wall.
        """
        return self.at_depth(task, None)

    def at_depth(self, task: Task, radial_depth: Array | None) -> ForceAlong:
        """The force with another radial depth (n,) m at each point, the wall staying where it is.

        Raises
        ------
        InputError
            As :meth:`along`; a depth off the mill; an engagement without a wall.
        """
        axes, chip, engaged = process_axes(task), self.chip(task), self.engagement
        entry, exit_ = np.full(task.path.n, engaged.entry), np.full(task.path.n, engaged.exit)
        if radial_depth is not None:
            if engaged.wall is None:
                raise InputError(
                    "radial depth of an engagement without a wall", code="K007", allowed="wall 'left' or 'right'"
                )
            swept = immersion(self.mill, radial_depth)
            entry, exit_ = (0.0 * swept, swept) if engaged.wall == "left" else (np.pi - swept, np.pi + 0.0 * swept)
        # Most paths have one cut, or few, for all their points.
        cuts, which = np.unique(np.stack([entry, exit_, chip], axis=1), axis=0, return_inverse=True)
        if self.instant == "generating":
            check_wall(task, engaged, axes)
            P = generating_matrix(self.mill, engaged, cuts[:, 0], cuts[:, 1], cuts[:, 2], self.height, SLICES)
        else:
            P = mean_matrix(self.mill, engaged.axial_depth, cuts[:, 0], cuts[:, 1], cuts[:, 2])
        values = self.coefficients.values
        covariance, note = _covariance(values, self.relative_sd, self.covariance, "cutting coefficients")
        others = self.coefficients.others
        if others is not None and self.covariance is None and self.relative_sd > 0.0:
            # An interval of 95 % that spans what each of the others says.
            apart = (others - values) / NORMAL_95
            covariance, note = covariance + apart.T @ apart, f"{note}; {NOT_MEASURED}"
            if len(others):
                note += f", widened to span what {len(others)} more published for this alloy"
        basis = np.swapaxes(axes.columns @ P[which.reshape(-1)], 1, 2)
        return ForceAlong(basis, values, covariance, NAMES, f"{note}; source of the values: {self.coefficients.source}")

    def peak(self, task: Task) -> Array:
        """Largest force of a revolution at each point, (n, 3) N, base axes. Errors as :meth:`along`."""
        chips, which = np.unique(self.chip(task), return_inverse=True)
        forces = peak_forces(self.mill, self.engagement, chips, self.coefficients.values)[which.reshape(-1)]
        return np.asarray(np.einsum("nij,nj->ni", process_axes(task).columns, forces))

    def torque(self, task: Task) -> Array:
        """Mean spindle torque (n,) N m. Errors as :meth:`chip`."""
        return mean_torque(self.mill, self.engagement, self.chip(task), self.coefficients.values)

    def generating(self, height: float | None = None) -> MillingForce:
        """The same cut, looked at while the wall is made. Errors as the class."""
        return replace(self, instant="generating", height=height)


def check_wall(task: Task, engagement: Engagement, axes: ProcessAxes) -> None:
    """Raise InputError unless the task's surface normals are those of the wall that the mill leaves."""
    along = engagement.wall_sign * np.einsum("ni,ni->n", task.normals, axes.cross)
    if (along < SAME_NORMAL).any():
        row = int(np.argmax(along < SAME_NORMAL))
        raise InputError(
            f"surface normal at path point {row}",
            code="K007",
            value=f"{np.degrees(np.arccos(np.clip(along[row], -1.0, 1.0))):.3g} deg off the wall's",
            allowed=f"out of the wall {engagement.wall} of the feed, within 1 deg",
            remedy="check the normals, the direction of the path, and up or down milling",
        )


def as_covariance(what: str, matrix: ArrayLike, size: int) -> Array:
    """A covariance (size, size).

    Raises
    ------
    InputError
        Another shape, values that are not finite, not symmetric, or a negative variance in some direction.
    """
    C = np.asarray(matrix, dtype=np.float64)
    allowed = f"({size}, {size}), finite, symmetric, no negative variance"
    if C.shape != (size, size) or not np.isfinite(C).all() or not np.allclose(C, C.T, rtol=1e-9, atol=0.0):
        raise InputError(what, code="K005", value=f"shape {C.shape}", allowed=allowed)
    scale = np.sqrt(np.maximum(np.diag(C), 0.0))
    scale[scale == 0.0] = 1.0
    # Units differ by orders of magnitude, so the check is on correlations; 1e-9 is round-off.
    if np.linalg.eigvalsh(C / np.outer(scale, scale)).min(initial=0.0) < -1e-9:
        raise InputError(what, code="K005", value="a negative variance", allowed=allowed)
    return C


def _covariance(value: Array, sd: float, given: Array | None, of: str) -> tuple[Array, str]:
    if given is not None:
        return given, f"{of}: covariance as given"
    if sd == 0.0:
        return np.zeros((len(value), len(value))), f"{of}: taken as exact"
    said = ", assumed" if sd == ASSUMED_SD else ""
    return np.diag((sd * value) ** 2), f"{of}: standard deviation {100 * sd:g} % each, independent{said}"


def along_cuts(force: CuttingForce, task: Task, cuts: Sequence[slice], *, at_start: bool) -> ForceAlong:
    """The force of each cut by itself, zero at points of the path that are in none: what joins two cuts is no feed.

    ``at_start``: also at the point that a cut starts from, which the move before leads to.

    Raises
    ------
    InputError
        No cuts; else as the force.
    """
    if not cuts:
        raise InputError(
            "cutting force of a path", code="K004", value="no move mills sideways", allowed="moves at feed"
        )
    parts = [force.along(task.at(cut)) for cut in cuts]
    basis = np.zeros((task.path.n, *parts[0].basis.shape[1:]))
    skipped = 0 if at_start else 1
    for cut, found in zip(cuts, parts, strict=True):
        basis[cut.start + skipped : cut.stop] = found.basis[skipped:]
    return replace(parts[0], basis=basis)


@dataclass(frozen=True, eq=False)
class ByRuns:
    """A cutting force looked at run by run, so that what lies between runs is no direction of feed.

    ``free`` (n - 1,): segments that do not mill: rapid moves, plunges.
    """

    force: CuttingForce
    free: Bools

    def along(self, task: Task) -> ForceAlong:
        """See :class:`machining.cutting.force.CuttingForce`."""
        ends = np.flatnonzero(self.free) + 1
        runs = [slice(int(a), int(b)) for a, b in zip([0, *ends], [*ends, task.path.n], strict=True)]
        return along_cuts(self.force, task, runs, at_start=True)
