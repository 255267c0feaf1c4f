"""What the readings say of each unknown: a value with its interval, a limit, or nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from doe.absolute.fit import Fit
from doe.absolute.unknowns import Layout, Unknown
from doe.certainty.combinations import groups
from robots.arrays import Array, Bools
from robots.constants import NORMAL_95

Status = Literal["determined", "one-sided", "at bound", "not identified"]
# An unknown is identified where the readings leave less than this share of what was open before them.
NARROWED = 0.3
# A joint's error curve is, where they leave less than this share of its height open; so are unknowns whose size they
# told first.
CURVE_KNOWN = 0.5
# Periodic errors up to this order are told one by one.
TOLD_ALONE = 4
# Members of a direction that is open, as a share of the largest.
MEMBER = 0.3
# Share of poses at angles that were not read, from which it is said.
UNREAD = 0.02
# Angles between which curves are looked at.
STEP_rad = float(np.radians(1.0))


@dataclass(frozen=True)
class Finding:
    """An unknown with what the readings say: ``value`` and ``interval95`` in ``unit``, None and NaN where nothing.

    A stiffness that may be infinite has an interval without an upper end, and no value.
    """

    name: str
    unit: str
    value: float | None
    interval95: tuple[float, float]
    status: Status


def findings(found: Fit) -> tuple[Finding, ...]:
    """Of every free unknown but periodic errors of high orders, which are told as a curve."""
    sd, before = found.sd, found.prior_sd
    highest = max((index[1] for _, index in found.moving.of("periodic")), default=0)
    out = []
    for k in found.free:
        one = found.layout.unknowns[k]
        if one.kind != "periodic" or highest <= TOLD_ALONE:
            out.append(_finding(one, float(found.u[k]), float(sd[k]), float(before[k])))
    return tuple(out)


def _finding(one: Unknown, u: float, sd: float, before: float) -> Finding:
    nothing = Finding(one.name, one.unit, None, (math.nan, math.nan), "not identified")
    if not sd < (CURVE_KNOWN if one.law else NARROWED) * before:
        return nothing
    low, high = u - NORMAL_95 * sd, u + NORMAL_95 * sd
    if one.kind != "spring":
        return Finding(one.name, one.unit, one.factor * u, (one.factor * low, one.factor * high), "determined")
    if low <= 0.0:
        return Finding(one.name, one.unit, None, (1.0 / high, math.inf), "one-sided") if high > 0.0 else nothing
    return Finding(one.name, one.unit, 1.0 / u, (1.0 / high, 1.0 / low), "determined")


@dataclass(frozen=True)
class Open:
    """Unknowns that these readings do not tell apart: ``names``, with as many ``directions`` left open among them."""

    names: tuple[str, ...]
    directions: int

    @property
    def words(self) -> str:
        """One sentence."""
        if len(self.names) == 1:
            return f"these readings do not identify {self.names[0]}"
        ways = "one combination" if self.directions == 1 else f"{self.directions} combinations"
        return f"these readings leave {ways} of {', '.join(self.names[:-1])} and {self.names[-1]} open"


def left_open(found: Fit) -> tuple[Open, ...]:
    """Groups of unknowns of which a combination is not identified; periodic errors that are part of a curve aside."""
    mine = [i for i, one in enumerate(found.moving.unknowns) if not one.law]
    before = found.prior_sd[found.free][mine]
    use = np.isfinite(before)
    mine = [i for i, good in zip(mine, use, strict=True) if good]
    if not mine:
        return ()
    scaled = found.half[mine] / before[use][:, None]
    U, s, _ = np.linalg.svd(scaled, full_matrices=False)
    ways = U[:, s > NARROWED].T
    there = np.abs(ways) > MEMBER * np.abs(ways).max(axis=1, initial=1e-300, keepdims=True)
    names = [found.moving.unknowns[i].name for i in mine]
    joined: Bools = (there.T.astype(int) @ there.astype(int)) > 0
    sets = [*groups(joined), *(np.array([k]) for k in range(len(names)) if joined[k].sum() == 1 and joined[k, k])]
    return tuple(
        Open(tuple(names[k] for k in sorted(members)), int(there[:, members].any(axis=1).sum())) for members in sets
    )


@dataclass(frozen=True)
class Curve:
    """A joint's error over its angle, without its mean: ``angle`` (a,) rad, ``error`` and ``half95`` (a,) rad.

    ``column``: of the joint's angle; ``known`` (a,): where the readings identify it; ``height``: its standard deviation
    before them.
    """

    joint: str
    column: int
    angle: Array
    error: Array
    half95: Array
    known: Bools
    height: float

    @property
    def ranges_deg(self) -> tuple[tuple[float, float], ...]:
        """Ends of the ranges of angles where it is identified."""
        deg, out = np.degrees(self.angle), []
        edges = np.flatnonzero(np.diff(np.concatenate([[0], self.known.astype(int), [0]])))
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            out.append((float(deg[first]), float(deg[end - 1])))
        return tuple(out)

    @property
    def is_known(self) -> bool:
        """Whether it is identified anywhere."""
        return bool(self.known.any())


def curves(found: Fit) -> tuple[Curve, ...]:
    """Error curves of the joints whose periodic errors were free, over a whole turn about the angles read."""
    out = []
    for j in sorted({i[0] for _, i in found.moving.of("periodic")}):
        read = found.data.q[:, j]
        centre = 0.5 * (read.min() + read.max())
        half_range = max(np.pi, 0.5 * float(np.ptp(read)))
        angle = np.arange(centre - half_range, centre + half_range, STEP_rad)
        out.append(_curve(found, found.layout, j, angle, read))
    return tuple(out)


def _rows(layout: Layout, joint: int, angle: Array) -> Array:
    B = np.zeros((len(angle), len(layout)))
    for k, (j, order, phase) in layout.of("periodic"):
        if j == joint:
            B[:, k] = (np.cos if phase else np.sin)(order * angle)
    return B


def _curve(found: Fit, layout: Layout, joint: int, angle: Array, read: Array) -> Curve:
    # What a curve and a zero have in common over the angles read is the zero's: shapes alone are compared.
    some = read if len(read) <= 2000 else read[:: -(-len(read) // 2000)]
    B = _rows(layout, joint, angle) - _rows(layout, joint, some).mean(axis=0)
    sd = np.sqrt(np.sum((B[:, found.free] @ found.half) ** 2, axis=1))
    before = np.where(np.isfinite(found.prior_sd), found.prior_sd, 0.0)
    open_ = np.sqrt(np.sum((B * before) ** 2, axis=1))
    height = float(np.sqrt(np.mean(open_**2)))
    near = np.min(np.abs(np.angle(np.exp(1j * (angle[:, None] - some[None, :])))), axis=1) < 5.0 * STEP_rad
    name = found.model.robot.joint_names[joint]
    return Curve(name, joint, angle, B @ found.u, NORMAL_95 * sd, near & (sd < CURVE_KNOWN * open_), height)


def unread_words(every: Sequence[Curve], q: Array) -> tuple[str, ...]:
    """Which joints stand, at poses q (n, dof) rad, at angles where their error curves are not identified."""
    out = []
    for c in every:
        if c.is_known:
            place = np.round((q[:, c.column] - c.angle[0]) % (2.0 * np.pi) / STEP_rad).astype(int)
            share = float(np.mean(~c.known[np.minimum(place, len(c.known) - 1)]))
            if share > UNREAD:
                out.append(
                    f"{c.joint} stands at angles where its error curve is not identified in {100.0 * share:.0f} % of "
                    f"the readings held out: predictions there allow for {1e3 * c.height:.2g} mrad"
                )
    return tuple(out)


def curve_words(every: Sequence[Curve]) -> tuple[str, ...]:
    """One sentence a curve: where it is identified, and what that means elsewhere."""
    out = []
    for c in every:
        if not c.is_known:
            out.append(f"{c.joint}: the readings do not identify its error curve")
            continue
        where = " and ".join(f"{a:.0f} to {b:.0f} deg" for a, b in c.ranges_deg)
        size = 1e3 * float(np.sqrt(np.mean(c.error[c.known] ** 2)))
        out.append(
            f"{c.joint}: error curve of {size:.2g} mrad RMS, identified from {where}; not identified elsewhere, where "
            f"predictions allow for {1e3 * c.height:.2g} mrad"
        )
    return tuple(out)
