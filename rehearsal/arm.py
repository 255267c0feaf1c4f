"""An arm as plain numbers (SI units, radians)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from robots.arrays import Array
from robots.schema.springs import LogFourierLaw, SpringLawTable


@dataclass(frozen=True)
class Section:
    """Outer dimensions in m; a tube has width = height = diameter."""

    kind: str
    width: float
    height: float
    wall: float


@dataclass(frozen=True)
class Link:
    """A straight or bent beam on body ``body`` (0 is the base, i the body behind joint i), tapering linearly."""

    name: str
    body: int
    points: Array  # (m, 3) in the body's frame
    up: Array  # the direction of the section's height, body frame
    start: Section
    end: Section
    youngs: float
    poisson: float


@dataclass(frozen=True)
class Bar:
    """The parallelogram: joints by index, pin in the forearm's frame, bar and crank as sections.

    ``stiffness`` N/m along the bar takes the place of what its section gives.
    """

    crank_about: int
    driven: int
    pin: Array
    bar: Section
    crank: Section
    youngs: float
    poisson: float
    bar_youngs: float
    stiffness: float | None = None


@dataclass(frozen=True)
class Give:
    """What gives way besides joints and links, and where loads really act: compliances (6, 6), forces before moments.

    ``base``: about the base's origin, its axes; ``tool``: at the tool point, flange axes; ``bearings`` (dof, 6, 6): in
    each joint's frame, z along its axis, which turns with it; ``bearing_laws``: joint, row and law on top of that.
    ``load_offset`` (3,) m flange axes, ``load_tilt`` (3,) rad, ``load_point`` (3,) m.
    """

    base: Array
    tool: Array
    bearings: Array
    bearing_laws: tuple[tuple[int, int, LogFourierLaw], ...] = ()
    load_offset: Array = field(default_factory=lambda: np.zeros(3))
    load_tilt: Array = field(default_factory=lambda: np.zeros(3))
    load_point: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def anything(self) -> bool:
        """Whether anything of it gives way."""
        return bool(self.base.any() or self.tool.any() or self.bearings.any() or self.bearing_laws)


@dataclass(frozen=True)
class Arm:
    """An arm of n joints: fixed transforms (R, t) before each, rotation about ``axes`` by sign * q + offset.

    ``couplings``: factors (n,), offset, low, high. ``stiffness``: N m/rad of the model's springs, None where a joint is
    held rigid; where it varies with angles, ``laws`` has the law, and the figure is the one in mid-range.
    """

    name: str
    joints: tuple[str, ...]
    coordinates: tuple[str, ...]
    rotations: Array  # (n, 3, 3)
    translations: Array  # (n, 3)
    axes: Array  # (n, 3)
    shifts: Array  # (n,) along the axis after the rotation (DH's d)
    signs: Array
    offsets: Array
    limits: Array  # (n, 2) rad, of the coordinates as named
    couplings: tuple[tuple[Array, float, float, float], ...]
    flange: Array
    flange_turn: Array  # (3, 3) the flange's axes in the last body
    tool: Array  # (3,) tool point in the flange frame
    links: tuple[Link, ...]
    bar: Bar | None
    parallelogram: bool
    stiffness: tuple[float | None, ...]
    laws: tuple[SpringLawTable | None, ...]
    give: Give

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.joints)

    def index(self, joint: str) -> int:
        """Number of a joint, from 0."""
        return self.joints.index(joint)

    @property
    def bar_at_work(self) -> Bar | None:
        """The bar where the forearm's moment goes down it; None in a serial chain."""
        return self.bar if self.parallelogram else None

    @property
    def reach(self) -> float:
        """Length (m) of the stretched arm from joint 2 (of one joint: from that) to the tool point."""
        steps = [*np.hypot(np.linalg.norm(self.translations, axis=1), self.shifts)[2:]]
        return float(sum(steps) + np.linalg.norm(self.flange) + np.linalg.norm(self.tool))
