"""Whether readings look like those of an arm of this class, or like other units: "these look like inches".

A deflection along with its load is linear in the joints' compliances, so the readings of all arms of a class fill a
convex set. A wrong unit multiplies all deflections, or divides all loads, by one factor. For a factor ``s`` the misfit

    R(s)^2 = min over springs of the class of mean(((s y - p) / (s size))^2)

is one small bounded least-squares problem (p: predicted with the links as the model has them, size: of the reading).
Readings as typed (s = 1) that no springs fit, while those of another scale are fitted well, are in other units. Angles
are judged by the same misfit of the table with its angles read as radians or grads. What is allowed is three times
wider than the class (:mod:`robots.arm_class`): arms at its soft end may be typed in kgf (9.8), at its stiff end in
cm (10), and nobody could tell; a factor of 100 is told for all but arms at the far end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import fdtrc, ndtr

from doe.certainty.doubts import Doubt
from doe.certainty.uncertainty import certainty
from doe.estimation.estimate import estimate
from doe.estimation.least_squares import bounded_step
from doe.estimation.problem import problem
from doe.tables.loaded import spring_parts
from doe.tables.measurements import Measurements
from fem import ArmModel
from fem.free.parameters import parameter
from robots import InputError, ModelDescription
from robots.arm_class import CLASS_PRIOR, MAIN_JOINTS, SHORTEST, ArmClass, arm_class, reach_of
from robots.arrays import Array
from robots.schema.description import BUILT_IN_SOURCES
from robots.schema.quantities import RotationalStiffness

# Factors tried: four decades on both sides, twenty steps each; all known units lie among them.
SCALES = np.logspace(-4.0, 4.0, 161)
# Readings much smaller than the median weigh as if they were this share of it: noise is what they mostly hold.
SMALLEST = 0.3
# A scale fits if its misfit exceeds the best one's by no more than this share of it, or this much.
FITS = 0.1, 0.02
# No scale fits better than this: the readings are of no such arm, whatever their units, and the units are not judged.
NO_ARM = 0.6
# Scales this far from any that fits are out, and the misfit then is no scatter: deflections of an arm at the end of
# what is allowed, with 20 % noise, are three times off with a probability below 1e-3 even where one reading is all.
FAR, FAR_MISFIT = 3.0, 0.5
# So far from any scale that fits no arm is, whatever its class, and whether or not a unit is known that explains it.
NO_ARM_AT_ALL = 100.0
# Nearer ones (but this far: models leave out a quarter of the compliance easily) must be significant: by the readings,
# and by the set-ups, which scatter as wholes.
NEAR, BY_READINGS, BY_SETUPS = 1.2, 1e-4, 0.1
# Arms beyond this share at either end of their class are remarked on, where they are so many times off its middle.
# Springs that a model states from a source are within the last factor with 95 % (published ones; assumed).
AT_CLASS_END, CLASS_TIMES, OWN = 0.05, 2.0, 2.0
# Units that are named, likeliest first.
NAMED = 3
# A spring is outside where its interval with this confidence is, and its value by this factor more; its readings have
# at least this resolution (m, rad).
SURE, BESIDE, GAUGE = 0.999, 1.25, 1e-5
# Springs are told apart down to this share of what the most important one gives.
APART = 1e-6
# Joints whose spring gives less than this share of what the most important one gives are held.
SEEN = 1e-3
# Angles: probability that the better misfit of the other reading is chance, set-ups taken as independent.
BY_ANGLES = 1e-5
# No table is fitted better than this: digits are rounded.
EXACT = 1e-4
ANGLES = (("radians", 180.0 / np.pi), ("grads", 0.9))


@dataclass(frozen=True)
class UnitChoice:
    """A unit that a column may have been typed in: SI deflection or load is ``factor`` times as if in the right one."""

    words: str
    factor: float
    column: str

    @property
    def scale(self) -> float:
        """By which deflection per load is to be multiplied."""
        return self.factor if self.column != "loads" else 1.0 / self.factor


TRANSLATIONS = (
    UnitChoice("micrometres", 1e-3, "deflections"),
    UnitChoice("dial divisions of 1/100 mm", 1e-2, "deflections"),
    UnitChoice("thousandths of an inch", 2.54e-2, "deflections"),
    UnitChoice("centimetres", 10.0, "deflections"),
    UnitChoice("inches", 25.4, "deflections"),
    UnitChoice("metres", 1e3, "deflections"),
)
ROTATIONS = (
    UnitChoice("microradians", 1e-3, "rotations"),
    UnitChoice("degrees", 1e3 * np.pi / 180.0, "rotations"),
    UnitChoice("radians", 1e3, "rotations"),
)
LOADS = (
    UnitChoice("pounds-force", 4.4482216, "loads"),
    UnitChoice("kgf", 9.80665, "loads"),
    UnitChoice("kN", 1e3, "loads"),
)


@dataclass(frozen=True)
class Suspicion:
    """Readings that are in other units by all appearance.

    ``looks_like``: columns and units that make them readings of such an arm, likeliest first, none if no known unit
    does; ``found`` and ``allowed``: what the readings imply and what the class has, in words; ``times``: how far the
    nearest scale that fits is from the one typed.
    """

    looks_like: tuple[str, ...]
    found: str
    allowed: str
    times: float = 1.0

    @property
    def is_certain(self) -> bool:
        """Whether a unit explains it, or nothing else can: an arm out of its class alone is no fault of the table."""
        return bool(self.looks_like) or self.times > NO_ARM_AT_ALL


@dataclass(frozen=True)
class Misfits:
    """Readings of one kind (translations or rotations) against springs of the class.

    ``A`` (m, dof): predicted per unit of compliance, ``links`` (m,): predicted of everything else, ``y`` (m,): read;
    each per unit of load and over the reading's ``size`` (m,), which is m/N or
    rad/N. ``low``, ``high`` (dof,): allowed compliances. ``setups``: how
    many different ones there are.
    """

    A: Array
    links: Array
    y: Array
    size: Array
    low: Array
    high: Array
    setups: int

    def at(self, scale: float) -> float:
        """R(scale): the misfit that springs of the class leave, as a share of the readings."""
        # Scaled readings against springs are readings against scaled springs and links.
        R, z = self._square
        low, high = self.low / scale, self.high / scale
        b = z - R[:, -1] / scale
        start = 0.5 * (low + high)
        x = start + bounded_step(R[:, :-1], b - R[:, :-1] @ start, low - start, high - start)
        return float(np.linalg.norm(b - R[:, :-1] @ x) / np.sqrt(len(self.y)))

    @cached_property
    def profile(self) -> Array:
        """R at all of SCALES."""
        return np.array([self.at(float(scale)) for scale in SCALES])

    @property
    def best(self) -> float:
        """The least misfit at any scale."""
        return float(self.profile.min())

    @cached_property
    def free(self) -> float:
        """The least misfit of any springs, rigid to negative, and links: R is below it at no scale."""
        R, z = self._square
        return float(np.linalg.norm(z - R @ np.linalg.lstsq(R, z, rcond=1e-10)[0]) / np.sqrt(len(self.y)))

    @cached_property
    def _square(self) -> tuple[Array, Array]:
        whole = np.asarray(np.linalg.qr(np.column_stack([self.A, self.links, self.y]), mode="r"))
        return whole[:, :-1], whole[:, -1]

    @property
    def typical(self) -> float:
        """Load over deflection, median of the readings, N/mm or N/mrad."""
        moved = np.abs(self.y * self.size)
        return float(1e-3 / np.median(moved[moved > 0.0]))

    @property
    def range_of_class(self) -> tuple[float, float]:
        """The same of the softest and the stiffest arm that is allowed."""
        soft, stiff = (np.median(np.abs(self.A @ c + self.links) * self.size) for c in (self.high, self.low))
        return float(1e-3 / max(soft, 1e-300)), float(1e-3 / max(stiff, 1e-300))

    @cached_property
    def springs(self) -> int:
        """Number of springs that the readings see apart."""
        seen = self.A * self.high
        return int(np.linalg.matrix_rank(seen, tol=APART * float(np.linalg.norm(seen, axis=0).max(initial=0.0))))


def misfits(model: ArmModel, data: Measurements, of: ArmClass, *, rotations: bool) -> Misfits | None:
    """The readings of one kind against springs of the class; None where none of that kind moves with a spring."""
    lever = max(reach_of(model.robot), SHORTEST)
    load = np.hypot(data.loads_N, np.linalg.norm(data.wrench[:, 3:], axis=1) / lever)
    mine = data.used & (load > 0.0)[:, None] & ((np.arange(6) >= 3) == rotations)
    influence, rest, value = (part[mine] for part in (*spring_parts(model, data), data.displacement))
    if not value.any():
        return None
    row, component = np.nonzero(mine)
    load = load[row]
    y = value / load
    size = np.hypot(y, SMALLEST * np.median(np.abs(y[y != 0.0]))) * load
    direction = data.wrench[row] / load[:, None]
    setups = len(np.unique(np.round(np.column_stack([data.q[row], direction, component]), 6), axis=0))
    low, high = of.allowed
    # Joint 1 and wrist joints may be rigid: joint 1 gives nothing under a vertical load and is often left out of models
    # and of synthetic readings; a wrist's share is small, and many arms give way there too little to be read.
    joint = np.arange(model.robot.dof)
    soft, stiff = 1.0 / low, np.where((joint > 0) & (joint < MAIN_JOINTS), 1.0 / high, 0.0)
    return Misfits(influence / size[:, None], rest / size, value / size, size / load, stiff, soft, setups)


def check_units(
    description: ModelDescription, model: ArmModel, data: Measurements, *, confirm_units: bool = False
) -> tuple[str, ...]:
    """Refuse a table that looks like other units; with ``confirm_units`` return what there is to remark instead.

    Raises
    ------
    InputError
        No arm of this class gives such readings as they are typed, but it would in other units.
    """
    found = suspicions(description, model, data)
    if not confirm_units and (certain := [one for one in found if one.is_certain]):
        first = certain[0]
        alike = " or ".join(first.looks_like)
        raise InputError(
            f"{data.source}: {f'these look like {alike}' if alike else 'these are no known units'}: {first.found}",
            code="T011",
            allowed=first.allowed,
            remedy="correct the column (loads N and N m, deflections mm and mrad, angles deg), or confirm with "
            "--confirm-units that the table is right as it is",
        )
    return tuple(
        f"{data.source} is taken as it is, though it looks like {' or '.join(s.looks_like) or 'no known units'}: "
        f"{s.found}; expected {s.allowed}"
        for s in found
    )


def suspicions(description: ModelDescription, model: ArmModel, data: Measurements) -> tuple[Suspicion, ...]:
    """What of a measurement table looks like other units, for an arm of this class; () if nothing does."""
    of = arm_class(description, model.robot)
    moved, turned = (misfits(model, data, of, rotations=kind) for kind in (False, True))
    if moved is not None and (angles := _by_angles(model, data, of, moved)):
        return angles
    found = [_by_scale(m, of, k) for m, k in ((moved, TRANSLATIONS), (turned, ROTATIONS)) if m is not None]
    out = tuple(one for one in found if one is not None)
    return out if out or moved is None else _by_springs(model, data, of, moved)


def class_doubt(description: ModelDescription, model: ArmModel, data: Measurements) -> Doubt | None:
    """Whether all that was read is softer or stiffer than arms of this class: a unit wrong by 2 to 5, or the load.

    The middle of the class would give one deflection per load; what was read is so many times it. Logarithms of
    stiffnesses are taken as normally distributed in a class, 95 % of them between its ends, and as one for all joints
    of an arm, for strong arms are strong in every joint. Springs whose source the model states count instead of the
    class, with 95 % within OWN times their value.
    """
    of = arm_class(description, model.robot)
    low, high = of.low.copy(), of.high.copy()
    for k, joint in enumerate(description.joint):
        own = joint.stiffness
        if isinstance(own, RotationalStiffness) and own.source not in (*BUILT_IN_SOURCES, CLASS_PRIOR):
            low[k], high[k] = own.si / OWN, own.si * OWN
    of = replace(of, low=low, high=high)
    m = misfits(model, data, of, rotations=False)
    if m is None:
        return None
    # Per load, not per size: what scatters beside small deflections would make any arm look stiff.
    each = m.A * m.size[:, None] / np.sqrt(of.low * of.high)
    middle = each.sum(axis=1) + m.links * m.size
    square = float(middle @ middle)
    softer = float((m.y * m.size) @ middle) / square if square > 0.0 else 0.0
    if softer <= 0.0:
        return None
    sd = float(np.abs(middle @ each) @ np.log(of.high / of.low)) / 4.0 / square
    p = float(ndtr(-abs(np.log(softer)) / max(sd, 1e-12)))
    times, way = max(softer, 1.0 / softer), "soft" if softer > 1.0 else "stiff"
    if p >= AT_CLASS_END or times < CLASS_TIMES:
        return None
    words = (
        f"{way} for its class by a factor of {times:.2g}: check units and load. Of arms of this class ({of.size}) "
        f"{100.0 * p:.2g} % are as {way} or more at these set-ups"
    )
    return Doubt("class", words, p, times)


def _by_scale(m: Misfits, of: ArmClass, own: tuple[UnitChoice, ...]) -> Suspicion | None:
    """Whether no springs of the class fit the readings as typed, while those of another scale are fitted."""
    typed = m.at(1.0)
    if typed <= _fitting(m.free):
        return None
    best, fitting = m.best, SCALES[m.profile <= _fitting(m.best)]
    off = float(np.exp(np.abs(np.log(fitting)).min()))
    if best > NO_ARM or off < NEAR:
        return None
    if not (off >= FAR and typed >= FAR_MISFIT) and not _is_significant(m, typed, best):
        return None
    unit, (soft, stiff) = ("N/mm" if own is TRANSLATIONS else "N/mrad"), m.range_of_class
    return Suspicion(
        _alike((*own, *LOADS), float(fitting[0]), float(fitting[-1])),
        f"a stiffness at the tool of {m.typical:.3g} {unit} (median of the readings)",
        f"{soft:.3g} to {stiff:.3g} {unit} at these set-ups, three times wider than arms of this class ({of.size}) are",
        off,
    )


def _fitting(best: float) -> float:
    """Largest misfit that still counts as fitting where ``best`` is the least."""
    return max((1.0 + FITS[0]) * best, best + FITS[1])


def _alike(choices: tuple[UnitChoice, ...], low: float, high: float) -> tuple[str, ...]:
    """Units whose scale lies between two that fit; those that make an arm from the middle of its class come first."""
    middle = 0.5 * (np.log(low) + np.log(high))
    known = [c for c in choices if low / NEAR <= c.scale <= high * NEAR]
    known = sorted(known, key=lambda c: abs(np.log(c.scale) - middle))[:NAMED]
    return tuple(f"{c.column} in {c.words}" for c in known)


def _is_significant(m: Misfits, typed: float, best: float) -> bool:
    """F tests: by all readings, with as many numbers as there are springs; by set-ups, where the scale is the one."""
    rise = typed**2 / best**2 - 1.0 if best > 0.0 else np.inf
    by_readings, by_setups = len(m.y) - m.springs - 1, m.setups - m.springs - 1
    if min(by_readings, by_setups, m.springs) < 1 or not np.isfinite(rise):
        return False
    readings = fdtrc(m.springs, by_readings, rise * by_readings / m.springs)
    return bool(readings < BY_READINGS and fdtrc(1, by_setups, rise * by_setups) < BY_SETUPS)


def _by_springs(model: ArmModel, data: Measurements, of: ArmClass, m: Misfits) -> tuple[Suspicion, ...]:
    """Whether a joint's spring is determined, as `calibrate` would, and lies outside what is allowed."""
    left = len(m.y) - m.springs - 1
    if min(left, m.springs) < 1:
        return ()
    rise = (m.at(1.0) / max(m.free, 1e-12)) ** 2 - 1.0
    if fdtrc(1, left, max(rise, 0.0) * left) > 1.0 - SURE:
        return ()  # springs within the class fit as well as any: nothing can be outside
    seen = np.linalg.norm(m.A * m.high, axis=0)
    joints = np.flatnonzero(seen > SEEN * seen.max())
    names = [f"{model.robot.joint_names[j]}.stiffness" for j in joints]
    found = estimate(problem(model, data, [parameter(model, name) for name in names]), (GAUGE, GAUGE))
    low, high = (end[joints] for end in of.allowed)
    high = np.where(m.low[joints] > 0.0, high, np.inf)  # what may be rigid may be as stiff as it likes
    out = []
    for k, one in enumerate(certainty(found, SURE).estimates):
        value, (least, most) = one.value, one.interval
        if one.status != "determined":
            continue
        soft = most < low[k] and value * BESIDE < low[k]
        if not (soft or (least > high[k] and value > high[k] * BESIDE)):
            continue
        ends = value / high[k], value / low[k]
        out.append(
            Suspicion(
                _alike((*TRANSLATIONS, *LOADS), *ends),
                f"{one.parameter.name} = {value:.3g} N m/rad ({least:.3g} to {most:.3g} with {100.0 * SURE:g} %)",
                f"{low[k]:.3g} to {high[k]:.3g} N m/rad, three times wider than arms of this class ({of.size}) have",
            )
        )
    return tuple(out)


def _is_chance(times: float, freedom: int) -> bool:
    """Whether one table's misfit may be so many times another's by chance."""
    return freedom < 1 or bool(fdtrc(freedom, freedom, times**2) >= BY_ANGLES)


def _by_angles(model: ArmModel, data: Measurements, of: ArmClass, typed: Misfits) -> tuple[Suspicion, ...]:
    """Whether the same table is fitted far better with its angles, typed as degrees, read as radians or grads."""
    for words, factor in ANGLES:
        q = data.q * factor
        other = misfits(model, replace(data, q=q), of, rotations=False) if model.robot.reachable(q).all() else None
        if other is None:
            continue
        better = max(other.at(1.0), EXACT)
        freedom = typed.setups - max(typed.springs, other.springs)
        if not _is_chance(typed.at(1.0) / better, freedom) and not _is_chance(typed.best / better, freedom):
            times = typed.best / better
            found = f"springs of this class fit them {times:.1f} times better with the angles read as {words}"
            return (Suspicion((f"joint angles in {words}",), found, "joint angles in degrees"),)
    return ()
