"""What a map tells of each pose, as a table of quantities: stiffness along the load, worst direction, what gives way.

A quantity is one :class:`Quantity`; anyone adds one by giving a map another row. Those of this package are
:data:`TABLE`, indices of machining are rows of :mod:`machining`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

import fem
from fem.statics.budget import whole_joints
from robots import InputError, singularity_distance
from robots.arrays import Array
from robots.constants import N_PER_M_TO_N_PER_MM
from robots.frames import unit_vector
from robots.inverse.singularities import NEAR_SINGULAR
from robots.robot import middle_pose

# Share of a pose's whole compliance below which that along the load is rounding.
RIGID = 1e-14
# The field that pictures and summaries of a joint sweep are about.
STIFFNESS_ARRAY = "stiffness_N_per_mm"


@dataclass(frozen=True)
class Kind:
    """A field: its ``name`` with unit, ``unit``, ``label`` for a colour bar.

    ``categories``: names of what whole numbers stand for, empty for numbers that are just that; ``of_parts``: these are
    the parts of the model.
    """

    name: str
    unit: str
    label: str
    categories: tuple[str, ...] = ()
    of_parts: bool = False


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses q (n, dof) rad of a model, and what several quantities need of them, each worked out once when asked for.

    ``direction`` (3,) of the load, unit length, base axes; ``point`` (3,) m, flange frame, instead of the model's tool
    point; ``parts``: names of the model's parts, where a quantity is about them.
    """

    model: fem.ArmModel
    q: Array
    direction: Array
    point: Array | None = None
    parts: tuple[str, ...] = ()

    @cached_property
    def compliance(self) -> Array:
        """Compliance (n, 6, 6) at the tool point."""
        return fem.compliance(self.model, self.q, self.point, threads=1, often=True)

    @property
    def translational(self) -> Array:
        """Compliance (n, 3, 3) m/N of the tool point by forces."""
        return self.compliance[:, :3, :3]

    @cached_property
    def least(self) -> Array:
        """Compliance (n,) m/N that is rounding."""
        return np.asarray(RIGID * np.trace(self.translational, axis1=1, axis2=2))

    @cached_property
    def along(self) -> Array:
        """Compliance (n,) m/N along the load."""
        return np.asarray(np.einsum("i,nij,j->n", self.direction, self.translational, self.direction))

    @cached_property
    def principal(self) -> tuple[Array, Array]:
        """Principal compliances (n, 3) m/N, ascending, 0 where they are rounding, and their directions as columns."""
        C = self.translational
        size, direction = np.linalg.eigh(0.5 * (C + C.swapaxes(1, 2)))
        return np.where(size > self.least[:, None], size, 0.0), direction

    @cached_property
    def share(self) -> Array:
        """Share (n, p) of each part in the compliance along the load; NaN where nothing deflects along it."""
        some = self.along > self.least
        out = np.full((len(self.q), len(self.parts)), np.nan)
        if some.any():
            load = np.concatenate([self.direction, np.zeros(3)])
            out[some] = fem.compliance_budget(self.model, self.q[some], load, self.point).share
        return out


@dataclass(frozen=True, eq=False)
class Quantity:
    """A row of the table.

    Parameters
    ----------
    short : what users call it
    kinds : the fields that it has
    of : poses -> one array (n,) a field; NaN where there is none
    merit : poses -> (n,) large is good, infinite where rigid, if a pose may be chosen by it
    common : whether a map has it where nothing else is said
    """

    short: str
    kinds: tuple[Kind, ...]
    of: Callable[[Poses], Sequence[Array]]
    merit: Callable[[Poses], Array] | None = None
    common: bool = True

    @property
    def of_parts(self) -> bool:
        """Whether it is about the model's parts."""
        return any(kind.of_parts for kind in self.kinds)


def one_field(short: str, name: str, unit: str, label: str, of: Callable[[Poses], Array], **more: bool) -> Quantity:
    """A quantity of one field that a pose may be chosen by."""
    return Quantity(short, (Kind(name, unit, label),), lambda p: [of(p)], lambda p: _endless(of(p)), **more)


def inverse(compliance_m_per_N: Array, least: Array | float = 0.0) -> Array:
    """Stiffness (n,) N/mm; NaN where nothing deflects but by rounding, ``least`` (n,) m/N."""
    some = compliance_m_per_N > least
    return np.where(some, N_PER_M_TO_N_PER_MM / np.where(some, compliance_m_per_N, 1.0), np.nan)


def _along_load(p: Poses) -> Array:
    """Stiffness (n,) N/mm along the load without forming the whole compliance; infinite where rigid."""
    load = np.concatenate([p.direction, np.zeros(3)])
    moved = fem.deflection(p.model, p.q, load, p.point, threads=1, often=True)[:, :3]
    return _endless(inverse(moved @ p.direction, RIGID * np.linalg.norm(moved, axis=1)))


def _isotropy(p: Poses) -> Array:
    size, _ = p.principal
    return np.asarray(np.divide(size[:, 0], size[:, 2], out=np.full(len(size), np.nan), where=size[:, 2] > 0.0))


def _worst_direction(p: Poses) -> Sequence[Array]:
    worst = p.principal[1][:, :, 2]
    return list((worst * one_sided(worst)[:, None]).T)


def _softest(p: Poses) -> Sequence[Array]:
    most = np.where(np.isfinite(p.share[:, 0]), p.share.argmax(axis=1), -1)
    return [most.astype(np.float64), p.share[np.arange(len(p.q)), most]]


def _singular(p: Poses) -> Sequence[Array]:
    sigma = singularity_distance(p.model.robot, p.q, point=p.point).sigma_min
    return [sigma, (sigma < NEAR_SINGULAR).astype(np.float64)]


YES_NO = ("no", "yes")
_AXES = ("x", "y", "z", "rx", "ry", "rz")
# Entries of the compliance matrix, upper triangle: displacement of row by load of column.
_ENTRIES = tuple((i, j) for i in range(6) for j in range(i, 6))


def _entry(i: int, j: int) -> Kind:
    """One entry of the 6 x 6 compliance, SI."""
    unit = ("m/N", "1/N", "rad/Nm")[(i > 2) + (j > 2)]
    name = f"compliance_{_AXES[i]}_{_AXES[j]}_{unit.replace('1/', 'per_').replace('/', '_per_')}"
    return Kind(name, unit, f"compliance {_AXES[i]} by {'force' if j < 3 else 'moment'} {_AXES[j][-1]}")


TABLE: tuple[Quantity, ...] = (
    Quantity(
        "stiffness",
        (Kind(STIFFNESS_ARRAY, "N/mm", "stiffness along the load"),),
        lambda p: [inverse(p.along, p.least)],
        _along_load,
    ),
    one_field(
        "worst",
        "worst_stiffness_N_per_mm",
        "N/mm",
        "stiffness in the worst direction",
        lambda p: inverse(p.principal[0][:, 2]),
    ),
    one_field(
        "best",
        "best_stiffness_N_per_mm",
        "N/mm",
        "stiffness in the best direction",
        lambda p: inverse(p.principal[0][:, 0]),
    ),
    one_field("isotropy", "isotropy", "", "isotropy, worst over best stiffness", _isotropy),
    Quantity(
        "directions",
        tuple(Kind(f"worst_direction_{name}", "", f"{name} of the worst direction") for name in "xyz"),
        _worst_direction,
        common=False,
    ),
    Quantity(
        "softest",
        (
            Kind("softest_part", "", "part that deflects most", of_parts=True),
            Kind("softest_part_share", "", "share of the part that deflects most"),
        ),
        _softest,
    ),
    Quantity(
        "singular",
        (
            Kind("jacobian_smallest_singular_value", "", "smallest singular value of the Jacobian"),
            Kind("near_singular", "", "near a singular pose", YES_NO),
        ),
        _singular,
    ),
    Quantity(
        "compliance",
        tuple(_entry(i, j) for i, j in _ENTRIES),
        lambda p: [p.compliance[:, i, j] for i, j in _ENTRIES],
        common=False,
    ),
)


def uncertainty(relative: Callable[[Array], Array]) -> Quantity:
    """Standard uncertainty of the stiffness: poses q (n, dof) rad -> relative (n,)."""
    kind = Kind("uncertainty_percent", "percent", "standard uncertainty of the stiffness")
    return Quantity("uncertainty", (kind,), lambda p: [100.0 * relative(p.q)])


def named(table: Iterable[Quantity], names: Iterable[str]) -> tuple[Quantity, ...]:
    """Rows with these short names, in the order of the table.

    Raises
    ------
    InputError
        No such row, or no name.
    """
    rows = {row.short: row for row in table}
    unknown = [name for name in names if name not in rows]
    if unknown or not list(names):
        raise InputError(
            "quantities of a map",
            code="S015",
            value=", ".join(unknown) or "none",
            allowed=", ".join(rows),
            remedy="choose from these",
        )
    return tuple(row for short, row in rows.items() if short in names)


@dataclass(frozen=True, eq=False)
class Quantities:
    """The quantities of a model's poses.

    Parameters
    ----------
    direction : (3,) of the load, base axes, any length
    rows : of a table, one or more
    shares : whether the share of each part is kept too
    point : (3,) m, flange frame, instead of the model's tool point

    Raises
    ------
    InputError
        A direction of length zero, no row, or parts of a model that has none.
    """

    model: fem.ArmModel
    direction: Array
    rows: tuple[Quantity, ...]
    shares: bool = False
    point: Array | None = None
    parts: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", unit_vector(self.direction, "load direction"))
        if not self.rows:
            raise InputError("quantities of a map", code="S015", value="none", allowed="one or more")
        need = self.shares or any(row.of_parts for row in self.rows)
        object.__setattr__(self, "parts", _parts(self.model) if need else ())

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Fields that come out, in the order of the rows."""
        return tuple(kind for row in self.rows for kind in row.kinds)

    def categories(self, name: str) -> tuple[str, ...]:
        """Names of what a field's whole numbers stand for; empty for numbers that are just that."""
        kind = next((kind for kind in self.kinds if kind.name == name), None)
        return () if kind is None else self.parts if kind.of_parts else kind.categories

    def merit(self, row: Quantity) -> Callable[[Array], Array]:
        """What a pose is chosen by: poses q (n, dof) rad -> (n,), large is good, in its field's unit; inf if rigid.

        Raises
        ------
        InputError
            A row that a pose cannot be chosen by.
        """
        chosen = row.merit
        if chosen is None:
            raise InputError(
                "quantity that a pose is chosen by",
                code="S015",
                value=row.short,
                allowed="one that is large where good",
            )
        return lambda q: chosen(self.poses(q))

    def poses(self, q: Array) -> Poses:
        """Poses q (n, dof) rad, as rows take them."""
        return Poses(self.model, q, self.direction, self.point, self.parts)

    def values(self, q: Array) -> dict[str, Array]:
        """All fields at poses q (n, dof) rad, (n,) each, and 'shares' (n, p) if they are kept.

        Raises
        ------
        InputError
            As :func:`fem.compliance` and :func:`fem.compliance_budget`.
        """
        p = self.poses(q)
        out = {kind.name: values for row in self.rows for kind, values in zip(row.kinds, row.of(p), strict=True)}
        return out | {"shares": p.share} if self.shares else out


def _parts(model: fem.ArmModel) -> tuple[str, ...]:
    """Names of a model's parts, as :func:`fem.compliance_budget` has them.

    Raises
    ------
    InputError
        There are none: everything is rigid.
    """
    given = fem.deflection_by_part(model, middle_pose(model.robot)[None], np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    parts = tuple(whole_joints(model, given))
    if not parts:
        raise InputError(
            "parts of the model",
            code="S015",
            value="nothing deflects",
            remedy="give it flexible links or joint springs",
        )
    return parts


def one_sided(direction: Array) -> Array:
    """Signs (n,) that make directions (n, 3), which have none of their own, point to the side of their largest part."""
    largest = np.take_along_axis(direction, np.abs(direction).argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.where(largest < 0.0, -1.0, 1.0)


def _endless(stiffness: Array) -> Array:
    """Stiffness (n,) as a merit: infinite where it is NaN because nothing deflects."""
    return np.where(np.isnan(stiffness), np.inf, stiffness)
