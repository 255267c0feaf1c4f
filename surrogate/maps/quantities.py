"""What a map tells of each pose: stiffness along the load and in the worst direction, isotropy, what gives way most."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

import fem
from fem.statics.budget import whole_joints
from robots import InputError, singularity_distance
from robots.arrays import Array
from robots.constants import N_PER_M_TO_N_PER_MM
from robots.inverse.singularities import NEAR_SINGULAR
from robots.robot import Robot
from surrogate.maps.orientation import unit_vector

# Share of a pose's whole compliance below which that along the load is rounding.
RIGID = 1e-14


@dataclass(frozen=True)
class Kind:
    """A quantity: ``short`` as users type it, the field's ``name`` with unit, ``unit``, ``label`` for a colour bar."""

    short: str
    name: str
    unit: str
    label: str


_AXES = ("x", "y", "z", "rx", "ry", "rz")
# Entries of the compliance matrix, upper triangle: displacement of row by load of column.
_ENTRIES = tuple((i, j) for i in range(6) for j in range(i, 6))


def _entry(i: int, j: int) -> Kind:
    """One entry of the 6 x 6 compliance, SI."""
    unit = ("m/N", "1/N", "rad/Nm")[(i > 2) + (j > 2)]
    name = f"compliance_{_AXES[i]}_{_AXES[j]}_{unit.replace('1/', 'per_').replace('/', '_per_')}"
    return Kind("compliance", name, unit, f"compliance {_AXES[i]} by {'force' if j < 3 else 'moment'} {_AXES[j][-1]}")


KINDS: tuple[Kind, ...] = (
    Kind("stiffness", "stiffness_N_per_mm", "N/mm", "stiffness along the load"),
    Kind("worst", "worst_stiffness_N_per_mm", "N/mm", "stiffness in the worst direction"),
    Kind("best", "best_stiffness_N_per_mm", "N/mm", "stiffness in the best direction"),
    Kind("isotropy", "isotropy", "", "isotropy, worst over best stiffness"),
    Kind("k_fs", "k_fs_N_per_mm", "N/mm", "k_fs along the normal"),
    Kind("directions", "worst_direction_x", "", "x of the worst direction"),
    Kind("directions", "worst_direction_y", "", "y of the worst direction"),
    Kind("directions", "worst_direction_z", "", "z of the worst direction"),
    Kind("softest", "softest_part", "", "part that gives way most"),
    Kind("softest", "softest_part_share", "", "share of the part that gives way most"),
    Kind("uncertainty", "uncertainty_percent", "percent", "standard uncertainty of the stiffness"),
    Kind("singular", "jacobian_smallest_singular_value", "", "smallest singular value of the Jacobian"),
    Kind("singular", "near_singular", "", "near a singular pose"),
    *(_entry(i, j) for i, j in _ENTRIES),
)
SHORTS: tuple[str, ...] = tuple(dict.fromkeys(kind.short for kind in KINDS))
# Those by which a pose may be chosen.
MERITS: tuple[str, ...] = ("stiffness", "worst", "best", "isotropy", "k_fs")
YES_NO = ("no", "yes")


@dataclass(frozen=True, eq=False)
class Quantities:
    """The quantities of a model's poses.

    Parameters
    ----------
    direction : (3,) of the load, base axes, any length
    wanted : of :data:`SHORTS`
    k_fs : C_tt (n, 3, 3) m/N -> (n,) N/m; its formula is no part of this package
    uncertainty : poses (n, dof) rad -> relative standard uncertainty (n,) of the stiffness along the load
    shares : whether the share of each part is kept too
    point : (3,) m, flange frame, instead of the model's tool point

    Raises
    ------
    InputError
        A direction of length zero, an unknown quantity, or one that nothing was given for.
    """

    model: fem.ArmModel
    direction: Array
    wanted: Sequence[str]
    k_fs: Callable[[Array], Array] | None = None
    uncertainty: Callable[[Array], Array] | None = None
    shares: bool = False
    point: Array | None = None
    parts: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", unit_vector(self.direction, "load direction"))
        unknown = [name for name in self.wanted if name not in SHORTS]
        if unknown or not self.wanted:
            raise InputError(
                "quantities of a map", value=", ".join(unknown) or "none", allowed=", ".join(SHORTS),
                remedy="choose from these",
            )  # fmt: skip
        missing = [n for n in ("k_fs", "uncertainty") if n in self.wanted and getattr(self, n) is None]
        if missing:
            raise InputError(f"{missing[0]} of a map", value="nothing to compute it with", remedy="leave it out")
        need = self.shares or "softest" in self.wanted
        object.__setattr__(self, "parts", _parts(self.model) if need else ())

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Fields that come out, in the order of :data:`KINDS`."""
        return tuple(kind for kind in KINDS if kind.short in self.wanted)

    def categories(self, name: str) -> tuple[str, ...]:
        """Names of what a field's whole numbers stand for; empty for numbers that are just that."""
        return {"softest_part": self.parts, "near_singular": YES_NO}.get(name, ())

    def values(self, q: Array) -> dict[str, Array]:
        """All fields at poses q (n, dof) rad, (n,) each, and 'shares' (n, p) if they are kept.

        Raises
        ------
        InputError
            As :func:`fem.compliance` and :func:`fem.compliance_budget`.
        """
        out: dict[str, Array] = {}
        wanted = set(self.wanted)
        if wanted & {"stiffness", "worst", "best", "isotropy", "k_fs", "directions", "compliance"} or self.parts:
            whole = self.compliance(q)
            C = whole[:, :3, :3]
            out |= self._of_compliance(C)
            if "compliance" in wanted:
                out |= {_entry(i, j).name: whole[:, i, j] for i, j in _ENTRIES}
        if self.parts:
            share = self._shares(q, C)
            known = np.isfinite(share[:, 0])
            most = np.where(known, share.argmax(axis=1), -1)
            out |= {"softest_part": most.astype(np.float64), "softest_part_share": share[np.arange(len(q)), most]}
            if self.shares:
                out["shares"] = share
        if self.uncertainty is not None and "uncertainty" in wanted:
            out["uncertainty_percent"] = 100.0 * self.uncertainty(q)
        if "singular" in wanted:
            sigma = singularity_distance(self.model.robot, q, point=self.point).sigma_min
            out["jacobian_smallest_singular_value"] = sigma
            out["near_singular"] = (sigma < NEAR_SINGULAR).astype(np.float64)
        keep = {kind.name for kind in self.kinds} | {"shares"}
        return {name: values for name, values in out.items() if name in keep}

    def merit(self, short: str) -> Callable[[Array], Array]:
        """One of :data:`MERITS` as a function of poses (n, dof) rad -> (n,), in its field's unit; infinite if rigid."""
        if short not in MERITS:
            raise InputError("quantity that a pose is chosen by", value=short, allowed=", ".join(MERITS))
        if short == "k_fs" and self.k_fs is None:
            raise InputError("k_fs of a map", value="nothing to compute it with", remedy="choose by another quantity")
        name = next(kind.name for kind in KINDS if kind.short == short)

        if short == "stiffness":
            return self._stiffness
        return lambda q: _endless(self._of_compliance(self.compliance(q)[:, :3, :3], only=short)[name])

    def compliance(self, q: Array) -> Array:
        """Compliance (n, 6, 6) at the tool point; by compiled loops where there are any."""
        return fem.compliance(self.model, q, self.point, threads=1, often=True)

    def _stiffness(self, q: Array) -> Array:
        """Stiffness (n,) N/mm along the load without forming the whole compliance; infinite where rigid."""
        load = np.concatenate([self.direction, np.zeros(3)])
        moved = fem.deflection(self.model, q, load, self.point, threads=1, often=True)[:, :3]
        return _endless(_inverse(moved @ self.direction, RIGID * np.linalg.norm(moved, axis=1)))

    def _of_compliance(self, C: Array, only: str | None = None) -> dict[str, Array]:
        wanted = set(self.wanted) if only is None else {only}
        out: dict[str, Array] = {}
        least = RIGID * np.trace(C, axis1=1, axis2=2)
        if "stiffness" in wanted:
            along = np.einsum("i,nij,j->n", self.direction, C, self.direction)
            out["stiffness_N_per_mm"] = _inverse(along, least)
        if wanted & {"worst", "best", "isotropy", "directions"}:
            size, direction = np.linalg.eigh(0.5 * (C + C.swapaxes(1, 2)))
            smallest = np.where(size[:, 0] > least, size[:, 0], 0.0)
            out["worst_stiffness_N_per_mm"] = _inverse(size[:, 2], least)
            out["best_stiffness_N_per_mm"] = _inverse(smallest, least)
            out["isotropy"] = np.divide(smallest, size[:, 2], out=np.full(len(C), np.nan), where=size[:, 2] > 0.0)
            worst = direction[:, :, 2] * one_sided(direction[:, :, 2])[:, None]
            out |= {f"worst_direction_{name}": worst[:, i] for i, name in enumerate("xyz")}
        if "k_fs" in wanted and self.k_fs is not None:
            out["k_fs_N_per_mm"] = self.k_fs(C) * N_PER_M_TO_N_PER_MM
        return out

    def _shares(self, q: Array, C: Array) -> Array:
        """Share (n, p) of each part in the compliance along the load; NaN where nothing gives way along it."""
        along = np.einsum("i,nij,j->n", self.direction, C, self.direction)
        some = along > RIGID * np.trace(C, axis1=1, axis2=2)
        out = np.full((len(q), len(self.parts)), np.nan)
        if some.any():
            load = np.concatenate([self.direction, np.zeros(3)])
            out[some] = fem.compliance_budget(self.model, q[some], load, self.point).share
        return out


def _parts(model: fem.ArmModel) -> tuple[str, ...]:
    """Names of a model's parts, as :func:`fem.compliance_budget` has them.

    Raises
    ------
    InputError
        There are none: everything is rigid.
    """
    given = fem.deflection_by_part(model, some_pose(model.robot), np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    parts = tuple(whole_joints(model, given))
    if not parts:
        raise InputError(
            "parts of the model", value="nothing gives way", remedy="give it flexible links or joint springs"
        )
    return parts


def one_sided(direction: Array) -> Array:
    """Signs (n,) that make directions (n, 3), which have none of their own, point to the side of their largest part."""
    largest = np.take_along_axis(direction, np.abs(direction).argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.where(largest < 0.0, -1.0, 1.0)


def some_pose(robot: Robot) -> Array:
    """A pose (1, dof) rad within limits: mid-range, moved towards zero until it can be taken."""
    zero = np.clip(0.0, robot.limits[:, 0], robot.limits[:, 1])
    middle = robot.limits.mean(axis=1)
    trials = middle + np.linspace(0.0, 1.0, 21)[:, None] * (zero - middle)
    reachable = np.flatnonzero(robot.reachable(trials))
    return np.asarray(trials[reachable[:1] if reachable.size else slice(1)])


def available(model: fem.ArmModel, *, k_fs: bool, uncertainty: bool) -> tuple[str, ...]:
    """What a map has by default: all but directions, the matrix, and what there is no means for."""
    without = {"directions", "compliance"}
    without |= {short for short, given in (("k_fs", k_fs), ("uncertainty", uncertainty)) if not given}
    return tuple(short for short in SHORTS if short not in without)


def field_of(name: str) -> Kind:
    """The quantity with this field name."""
    return next(kind for kind in KINDS if kind.name == name)


def _inverse(compliance_m_per_N: Array, least: Array) -> Array:
    """Stiffness (n,) N/mm; NaN where nothing gives way but by rounding, ``least`` (n,) m/N."""
    some = compliance_m_per_N > least
    return np.where(some, N_PER_M_TO_N_PER_MM / np.where(some, compliance_m_per_N, 1.0), np.nan)


def _endless(stiffness: Array) -> Array:
    """Stiffness (n,) as a merit: infinite where it is NaN because nothing gives way."""
    return np.where(np.isnan(stiffness), np.inf, stiffness)
