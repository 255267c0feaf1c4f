"""Compliance budgets of one pose and of the whole workspace, and what they say in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
from scipy.stats import binned_statistic

from fem import ArmModel, Budget, PartKind, compliance_budget
from robots import forward_kinematics, tool_position
from robots.arrays import Array, Integers
from robots.constants import M_TO_MM
from robots.quantities import rounded
from stiffarm.session.workspace import DOWN, WORKSPACE_POSES, workspace_poses

# A part is named as leading where it leads in this share of the poses at least.
_WORTH_NAMING = 0.05
# Bins of reach: about so many, and each with so many poses at least.
_BINS, _LEAST_POSES = 9, 15
_KINDS: Final[dict[PartKind, str]] = {
    "joint": "joints",
    "link": "links",
    "parallelogram": "bar and crank",
    "other": "base and tool",
}


@dataclass(frozen=True)
class PoseBudget:
    """One pose: names and kinds of the p parts, energy (p,) J, and the load they are under.

    ``along`` (p,): what each part adds to the tool's motion along the load, in ``along_unit``: mm for a force,
    mrad for a moment, None for both at once, where no single direction is the load's.
    """

    parts: tuple[str, ...]
    kinds: tuple[PartKind, ...]
    energy: Array
    along: Array | None
    along_unit: str

    @property
    def share(self) -> Array:
        """Share (p,) of the strain energy, adding up to 1."""
        return np.asarray(self.energy / self.energy.sum())

    @property
    def order(self) -> list[int]:
        """Parts by energy, largest first."""
        return [int(i) for i in np.argsort(-self.energy, kind="stable")]

    @property
    def largest(self) -> str:
        """The part that stores most."""
        return self.parts[self.order[0]]

    @property
    def leader(self) -> str:
        """Which part gives most, in words; of a model with rigid joints that is not what gives most in the arm."""
        words = f"{self.largest} deflects most, {100.0 * self.share[self.order[0]]:.0f} %"
        return words if "joint" in self.kinds else f"{words} (all joints rigid)"

    def payload(self) -> dict[str, Any]:
        """For budget.json: parts by size, with units."""
        total = float(self.energy.sum())
        out: dict[str, Any] = {"strain_energy_mJ": rounded(total * 1e3), "largest": self.largest, "leader": self.leader}
        if self.along is not None:
            out[f"along_load_{self.along_unit}"] = rounded(float(self.along.sum()))
        out["parts"] = [
            {
                "part": self.parts[i],
                "kind": self.kinds[i],
                "share": rounded(float(self.share[i])),
                "strain_energy_mJ": rounded(float(self.energy[i]) * 1e3),
                **({} if self.along is None else {f"along_load_{self.along_unit}": rounded(float(self.along[i]))}),
            }
            for i in self.order
        ]
        out["share_by_kind"] = {
            kind: rounded(float(self.share[[k == kind for k in self.kinds]].sum()))
            for kind in dict.fromkeys(self.kinds)
        }
        return out


def pose_budget(model: ArmModel, q: Array, wrench: Array, point: Array | None = None) -> PoseBudget:
    """Budget of one pose q (dof,) under one load (6,); errors as in :func:`fem.statics.budget.compliance_budget`."""
    found = compliance_budget(model, q[None], wrench, point)
    energy = found.part_energy[0]
    force, moment = (float(np.linalg.norm(v)) for v in (wrench[:3], wrench[3:]))
    # Work of the load: twice the energy; along the load alone where it is a force or a moment.
    size, unit = (force, "mm") if moment == 0.0 else (moment, "mrad")
    along = 2.0 * energy / size * 1e3 if force == 0.0 or moment == 0.0 else None
    return PoseBudget(found.parts, found.kinds, energy, along, unit)


@dataclass(frozen=True)
class WorkspaceBudget:
    """Budgets over the workspace: n poses (n, dof) rad, horizontal reach of the tool (n,) mm, swept coordinates."""

    budget: Budget
    q: Array
    reach_mm: Array
    swept: tuple[str, ...]

    def edges_mm(self) -> Array:
        """Edges of the bins of reach, at round steps; bins at the ends with few poses join their neighbours."""
        low, high = float(self.reach_mm.min()), float(self.reach_mm.max())
        wide = max(high - low, 1.0) / _BINS
        decade = 10.0 ** np.floor(np.log10(wide))
        step = next(s * decade for s in (1.0, 2.0, 2.5, 5.0, 10.0) if s * decade >= 0.999 * wide)
        edges = np.arange(np.floor(low / step), np.ceil(high / step) + 0.5) * step
        if len(edges) < 2:
            edges = np.array([edges[0], edges[0] + step])
        while len(edges) > 2 and self._count(edges)[0] < _LEAST_POSES:
            edges = np.delete(edges, 1)
        while len(edges) > 2 and self._count(edges)[-1] < _LEAST_POSES:
            edges = np.delete(edges, -2)
        return np.asarray(edges)

    def _count(self, edges: Array) -> Integers:
        return np.asarray(np.histogram(self.reach_mm, edges)[0])

    def mean_share(self, edges: Array) -> Array:
        """Mean share of each part in each bin (bins, p); NaN where a bin has no pose."""
        return np.asarray(binned_statistic(self.reach_mm, self.budget.share.T, "mean", edges)[0].T)

    def quantiles(self, levels: Sequence[float]) -> Array:
        """Quantiles of each part's share (levels, p)."""
        return np.quantile(self.budget.share, levels, axis=0)

    def payload(self) -> dict[str, Any]:
        """For budget.json."""
        low, middle, high = self.quantiles((0.05, 0.5, 0.95))
        edges = self.edges_mm()
        mean = self.mean_share(edges)
        return {
            "poses": len(self.q),
            "swept": list(self.swept),
            "load": "fz_N = -1",
            "parts": [
                {
                    "part": name,
                    "kind": kind,
                    "median_share": rounded(float(middle[i])),
                    "share_5_to_95_percent": [rounded(float(low[i])), rounded(float(high[i]))],
                }
                for i, (name, kind) in enumerate(zip(self.budget.parts, self.budget.kinds, strict=True))
            ],
            "reach_edges_mm": [rounded(float(v)) for v in edges],
            "mean_share_by_reach": {
                name: [rounded(float(v)) for v in mean[:, i]] for i, name in enumerate(self.budget.parts)
            },
        }

    def sentences(self) -> list[str]:
        """Two or three sentences: what joints and links give, which part leads, and where."""
        kinds = [] if len(set(self.budget.kinds)) == 1 else [self._kinds_sentence()]
        return [*kinds, self._leaders_sentence(), self._reach_sentence()]

    def _kinds_sentence(self) -> str:
        found = []
        for kind in dict.fromkeys(self.budget.kinds):
            low, middle, high = (float(v) for v in np.quantile(self.budget.of_kind(kind), (0.05, 0.5, 0.95)))
            found.append((middle, f"{_KINDS[kind]} {_percent(middle)} ({_percent(low)} to {_percent(high)})"))
        listed = ", ".join(text for _, text in sorted(found, reverse=True))
        return f"Shares in the strain energy, as the median and the range of nine poses in ten: {listed}."

    def _leaders_sentence(self) -> str:
        count = np.bincount(self.budget.share.argmax(axis=1), minlength=len(self.budget.parts)) / len(self.q)
        leading = [int(i) for i in np.argsort(-count, kind="stable") if count[i] >= _WORTH_NAMING]
        if count[leading[0]] >= 0.995:
            every = "every pose" if count[leading[0]] == 1.0 else "nearly every pose"
            return f"The largest share is that of {self.budget.parts[leading[0]]} in {every}."
        listed = [f"{self.budget.parts[i]} in {_percent(float(count[i]))}" for i in leading]
        return f"The largest share is that of {listed[0]} of the poses{''.join(f', {text}' for text in listed[1:])}."

    def _reach_sentence(self) -> str:
        edges = self.edges_mm()
        mean = self.mean_share(edges)
        known = np.flatnonzero(~np.isnan(mean[:, 0]))
        leader = mean[known].argmax(axis=1)
        starts = np.flatnonzero(np.diff(leader, prepend=-1))
        names = [self.budget.parts[leader[i]] for i in starts]
        if len(names) == 1:
            return f"On average {names[0]} leads at every horizontal reach of the tool."
        ends = [float(edges[known[i]]) for i in starts[1:]]
        listed = [f"{names[0]} up to {ends[0]:.0f} mm"]
        listed += [
            f"{name} from {a:.0f} to {b:.0f} mm" for name, (a, b) in zip(names[1:-1], pairwise(ends), strict=True)
        ]
        return f"By the tool's horizontal reach, on average {', '.join(listed)} and {names[-1]} beyond lead."


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share >= 0.01 or share == 0.0 else "below 1 %"


def workspace_budget(model: ArmModel, poses: int = WORKSPACE_POSES) -> WorkspaceBudget:
    """Budgets under a vertical load at the poses of :func:`stiffarm.session.workspace.workspace_poses`.

    Raises
    ------
    InputError
        No pose can be taken, or the model is rigid.
    """
    q, names = workspace_poses(model.robot, poses)
    budget = compliance_budget(model, q, np.array(DOWN))
    tool = tool_position(model.robot, forward_kinematics(model.robot, q))
    return WorkspaceBudget(budget, q, np.hypot(tool[:, 0], tool[:, 1]) * M_TO_MM, names)
