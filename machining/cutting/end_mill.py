"""Forces of an end mill by the mechanistic model with linear edge forces.

Altintas, Manufacturing Automation (2nd ed. 2012), chapter 2. Axes as in :mod:`machining.cutting.process_axes`. The
tooth angle phi turns with the spindle, clockwise seen from the holder, from 0 on the cross-feed axis; the chip is
``h = c sin phi`` thick, c the feed per tooth, and all forces are those *on the tool*::

    F_feed  = -F_t cos phi - F_r sin phi        F_cross = F_t sin phi - F_r cos phi        F_axis = -F_a

F_a > 0 pulls the tool out of its holder, as a right-hand helix on a right-hand cutter does. At height z above the tip
a tooth lags by ``k z``, ``k = 2 tan(helix) / D``. Forces are linear in the six coefficients, so everything here is a
matrix that multiplies them. Integrals over the tooth and over the revolution are exact.

Limits: cylindrical cutter, equal pitch, no run-out, no ploughing below a least chip, no chatter; the circular tooth
path holds for feeds per tooth far below the diameter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from robots import InputError, require_positive
from robots.arrays import Array

# Lag over the whole depth (rad) below which teeth are straight: less changes no force beyond round-off.
STRAIGHT = 1e-9
# Angles this close (rad) to an end of the cut are in it: a straight tooth makes the wall where it enters or leaves.
AT_END = 1e-9
# Rotations of a pitch that are looked at for the peak.
PEAK_STEPS = 720
# Cuts worked on at once: bounds the memory, not the result.
CUTS = 256


@dataclass(frozen=True)
class EndMill:
    """A cylindrical end mill, right-hand cut: ``diameter`` m, number of ``teeth``, right-hand ``helix`` rad.

    Raises
    ------
    InputError
        A diameter that is not positive, no teeth, or a helix outside 0 to below 90 deg.
    """

    diameter: float
    teeth: int
    helix: float = 0.0

    def __post_init__(self) -> None:
        require_positive("diameter of the mill", self.diameter, "m", code="K005")
        if isinstance(self.teeth, bool) or self.teeth != int(self.teeth) or self.teeth < 1:
            raise InputError("teeth of the mill", code="K005", value=self.teeth, allowed="a whole number, 1 or more")
        if not 0.0 <= self.helix < 0.5 * np.pi:
            raise InputError(
                "helix angle of the mill",
                code="K005",
                value=f"{np.degrees(self.helix):g} deg",
                allowed="0 to below 90 deg, right-hand",
                remedy="angles are rad here",
            )

    @property
    def lag(self) -> float:
        """Lag k of a tooth over its height, rad/m."""
        return float(2.0 * np.tan(self.helix) / self.diameter)

    @property
    def pitch(self) -> float:
        """Angle from tooth to tooth, rad."""
        return 2.0 * np.pi / self.teeth


@dataclass(frozen=True)
class Engagement:
    """What of the mill is in the cut: ``axial_depth`` m, tooth angles ``entry`` to ``exit`` rad.

    ``wall``: the side of the feed on which the mill leaves a wall: "left" at tooth angle 0 (up milling), "right" at
    pi (down milling), None where it leaves none (face milling within the part). Made by :func:`up_milling`,
    :func:`down_milling`, :func:`slotting`, or from angles.

    Raises
    ------
    InputError
        A depth that is not positive, angles outside 0 to pi or out of order, or a wall where no tooth cuts.
    """

    axial_depth: float
    entry: float
    exit: float
    wall: Literal["left", "right"] | None = None

    def __post_init__(self) -> None:
        require_positive("axial depth of cut", self.axial_depth, "m", code="K005")
        if not 0.0 <= self.entry < self.exit <= np.pi:
            raise InputError(
                "entry and exit angle",
                code="K005",
                value=f"{np.degrees(self.entry):g} to {np.degrees(self.exit):g} deg",
                allowed="0 <= entry < exit <= 180 deg",
                remedy="angles are rad here",
            )
        reached = {None: True, "left": self.entry == 0.0, "right": self.exit == np.pi}
        if not reached.get(self.wall, False):
            raise InputError(
                "wall of the engagement",
                code="K005",
                value=self.wall,
                allowed="'left' with entry 0, 'right' with exit 180 deg, or None",
            )

    @property
    def generating(self) -> float | None:
        """Tooth angle that makes the wall, rad."""
        return None if self.wall is None else (0.0 if self.wall == "left" else float(np.pi))

    @property
    def wall_sign(self) -> float:
        """Cross-feed component of the wall's outward normal: -1 left, +1 right, 0 without a wall."""
        return {None: 0.0, "left": -1.0, "right": 1.0}[self.wall]


def up_milling(mill: EndMill, axial_depth: float, radial_depth: float) -> Engagement:
    """Up milling, the wall left of the feed; ``radial_depth`` m up to the diameter. Errors as :class:`Engagement`."""
    return Engagement(axial_depth, 0.0, float(immersion(mill, radial_depth)), "left")


def down_milling(mill: EndMill, axial_depth: float, radial_depth: float) -> Engagement:
    """Down (climb) milling, the wall right of the feed. Arguments and errors as :func:`up_milling`."""
    return Engagement(axial_depth, float(np.pi - immersion(mill, radial_depth)), np.pi, "right")


def slotting(mill: EndMill, axial_depth: float, wall: Literal["left", "right"] | None = None) -> Engagement:
    """Full immersion; ``wall``: which of the slot's two is looked at. Errors as :class:`Engagement`."""
    return Engagement(axial_depth, float(immersion(mill, mill.diameter)) - np.pi, np.pi, wall)


def immersion(mill: EndMill, radial_depth: float | Array) -> Array:
    """Angle of engagement (rad) of a mill that cuts ``radial_depth`` m deep from its side.

    Raises
    ------
    InputError
        A depth that is not above 0 and up to the diameter.
    """
    depth = np.asarray(radial_depth, dtype=np.float64)
    bad = ~((depth > 0.0) & (depth <= mill.diameter))
    if bad.any():
        raise InputError(
            "radial depth of cut",
            code="K005",
            value=f"{float(np.extract(bad, depth)[0]) * 1e3:g} mm",
            allowed=f"more than 0, up to the diameter {mill.diameter * 1e3:g} mm",
            remedy="lengths are m here",
        )
    return np.asarray(np.arccos(1.0 - 2.0 * depth / mill.diameter))


def mean_matrix(mill: EndMill, depth: float, entry: Array, exit_: Array, chip: Array) -> Array:
    """Mean force over a revolution per coefficient, (n, 3, 6).

    ``F_mean = N a / (2 pi) integral dF/dz dphi`` over the cut; the helix does not matter to it. ``entry``, ``exit_``
    (n,) rad, ``chip`` (n,) m feed per tooth. A full slot gives ``F_feed = -N a (c K_rc / 4 + K_re / pi)``,
    ``F_cross = N a (c K_tc / 4 + K_te / pi)``, ``F_a = N a (c K_ac / pi + K_ae / 2)``.
    """
    share = mill.teeth * depth * (exit_ - entry) / (2.0 * np.pi)
    return np.asarray(share[:, None, None] * _means(entry, exit_, chip))


def instant_matrix(mill: EndMill, depth: float, entry: Array, exit_: Array, chip: Array, rotation: Array) -> Array:
    """Force per coefficient with the first tooth's tip at ``rotation`` (m,) rad, (n, m, 3, 6).

    The integral over z is in closed form; for straight teeth it is the limit. Other arguments: :func:`mean_matrix`.
    """
    tip = np.mod(rotation[:, None] + mill.pitch * np.arange(mill.teeth), 2.0 * np.pi)
    swept = mill.lag * depth
    total = np.zeros((len(entry), len(rotation), 3, 6))
    # A tooth of much lag reaches back into the cuts of earlier turns.
    for turn in range(-int(np.ceil(swept / (2.0 * np.pi))) - 1, 2):
        start, end = (e[:, None, None] + 2.0 * np.pi * turn for e in (entry, exit_))
        low, high = np.maximum(tip - swept, start), np.minimum(tip, end)
        if swept < STRAIGHT:
            height = np.where(high - low >= -AT_END, depth, 0.0)
            low, high = tip + 0.0 * low, tip + 0.0 * high
        else:
            height = np.maximum(high - low, 0.0) / mill.lag
        parts = _means(low, np.maximum(high, low), chip[:, None, None])
        total += np.sum(height[..., None, None] * parts, axis=2)
    return total


def generating_matrix(
    mill: EndMill, engagement: Engagement, entry: Array, exit_: Array, chip: Array, height: float | None, slices: int
) -> Array:
    """Force per coefficient while the wall is made, (n, 3, 6).

    At ``height`` z above the tip the wall is made when a tooth there stands at the wall: tip angle ``phi + k z``.
    None: the mean over the axial depth, by the midpoint rule on ``slices``.
    """
    angle = engagement.generating
    assert angle is not None  # noqa: S101 - the caller has checked
    z = np.array([height]) if height is not None else (np.arange(slices) + 0.5) / slices * engagement.axial_depth
    out, rotation = np.empty((len(chip), 3, 6)), angle + mill.lag * z
    for first in range(0, len(chip), CUTS):
        rows = slice(first, first + CUTS)
        at = instant_matrix(mill, engagement.axial_depth, entry[rows], exit_[rows], chip[rows], rotation)
        out[rows] = at.mean(axis=1)
    return out


def peak_forces(mill: EndMill, engagement: Engagement, chip: Array, values: Array) -> Array:
    """Force (n, 3) N at the rotation where it is largest, on a grid of :data:`PEAK_STEPS` a pitch."""
    n = len(chip)
    entry, exit_ = np.full(n, engagement.entry), np.full(n, engagement.exit)
    rotation = np.arange(PEAK_STEPS) / PEAK_STEPS * mill.pitch
    forces = instant_matrix(mill, engagement.axial_depth, entry, exit_, chip, rotation) @ values
    return np.asarray(forces[np.arange(n), np.linalg.norm(forces, axis=2).argmax(axis=1)])


def mean_torque(mill: EndMill, engagement: Engagement, chip: Array, values: Array) -> Array:
    """Mean torque (n,) N m on the spindle; times its speed (rad/s) the cutting power."""
    width, middle = engagement.exit - engagement.entry, 0.5 * (engagement.exit + engagement.entry)
    sine = np.sin(middle) * np.sinc(width / (2.0 * np.pi))
    tangential = values[0] * chip * sine + values[1]
    share = mill.teeth * engagement.axial_depth * width / (2.0 * np.pi)
    return np.asarray(0.5 * mill.diameter * share * tangential)


class Bending(Protocol):
    """What :func:`machining.cutting.surface_error` takes for a tool that bends."""

    @property
    def compliance(self) -> float:
        """Compliance across the tool axis, m/N."""
        ...

    @property
    def relative_sd(self) -> float:
        """Standard deviation of it as a share."""
        ...

    def matrices(self, axes: Array) -> Array:
        """Compliance (n, 3, 3) m/N for tool axes (n, 3), unit vectors."""
        ...


@dataclass(frozen=True)
class ToolBending:
    """The tool's own bending, added to the arm's compliance: a round bar clamped in the holder, loaded at its tip.

    It gives way by ``L^3 / (3 E I)`` across the tool axis, and is rigid along it.

    ``stickout`` L m, ``diameter`` m of the bar that bends alike (flutes take away stiffness: some 0.8 of the cutting
    diameter is a usual guess, to be stated by the caller), ``modulus`` Pa (carbide some 600e9, steel 210e9).
    ``relative_sd``: standard deviation of this compliance, share of it.

    Raises
    ------
    InputError
        A length or modulus that is not positive, or an uncertainty outside 0 to 0.5.
    """

    stickout: float
    diameter: float
    modulus: float
    relative_sd: float = 0.0

    def __post_init__(self) -> None:
        for what, value, unit in (
            ("stickout of the tool", self.stickout, "m"),
            ("diameter of the bending tool", self.diameter, "m"),
            ("modulus of the tool", self.modulus, "Pa"),
        ):
            require_positive(what, value, unit, code="K005")
        if not 0.0 <= self.relative_sd <= 0.5:
            raise InputError(
                "relative standard deviation of the tool", code="K005", value=self.relative_sd, allowed="0 to 0.5"
            )

    @property
    def compliance(self) -> float:
        """Compliance across the tool axis, m/N."""
        return float(64.0 * self.stickout**3 / (3.0 * np.pi * self.modulus * self.diameter**4))

    def matrices(self, axes: Array) -> Array:
        """Compliance (n, 3, 3) m/N for tool axes (n, 3), unit vectors."""
        return np.asarray(self.compliance * (np.eye(3) - axes[:, :, None] * axes[:, None, :]))


def _means(low: Array, high: Array, chip: Array) -> Array:
    """Mean of dF/dz per coefficient over tooth angles low to high, (..., 3, 6): no difference of large numbers."""
    width, middle = high - low, 0.5 * (high + low)
    once, twice = np.sinc(width / (2.0 * np.pi)), np.sinc(width / np.pi)
    sin, cos = np.sin(middle) * once, np.cos(middle) * once
    mixed, square = 0.5 * np.sin(2.0 * middle) * twice, 0.5 * (1.0 - np.cos(2.0 * middle) * twice)
    out = np.zeros((*np.broadcast(width, chip).shape, 3, 6))
    out[..., 0, 0], out[..., 0, 1], out[..., 0, 2], out[..., 0, 3] = -chip * mixed, -cos, -chip * square, -sin
    out[..., 1, 0], out[..., 1, 1], out[..., 1, 2], out[..., 1, 3] = chip * square, sin, -chip * mixed, -cos
    out[..., 2, 4], out[..., 2, 5] = -chip * sin, -1.0
    return out
