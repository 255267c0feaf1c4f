"""Numbers of two calibrations, diagnoses or placements side by side: by how much they differ, and whether beyond noise.

A number that was estimated is compared in the variable in which its error is normal (the compliance of a stiffness),
with the standard deviations of both: the difference over its own follows Student's t (Welch 1947). Of several numbers
some differ by chance: they are judged together (Holm 1979), and where both covariances are stored all at once by the
chi-square of the differences.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from scipy.stats import chi2, t

from robots.constants import NORMAL_95
from robots.schema.uncertainty import CalibrationUncertainty
from stiffarm.commands.compare.sources import Source

Verdict = Literal["beyond the noise", "perhaps", "within the noise", "undecided", "other"]
LEVEL: Final = 0.05
# Standard deviations below this share of the number are those of an exact one.
EXACT: Final = 1e-9
# Beyond this it is no figure of an arm, and squares overflow.
LARGEST: Final = 1e60


@dataclass(frozen=True)
class Figure:
    """A number with what is known of it: its 95 % interval, open where None; ``sd`` of its ``variable``, NaN if none.

    ``value`` None: not determined.
    """

    name: str
    unit: str
    value: float | None
    low: float | None
    high: float | None
    variable: str = "value"
    sd: float = math.nan
    freedom: float = math.inf

    @property
    def inner(self) -> float:
        """The value in its variable."""
        if self.value is None:
            return math.nan
        if self.variable == "1/value":
            return 1.0 / self.value if self.value else math.inf
        return math.log(self.value) if self.variable == "ln value" and self.value > 0.0 else self.value


@dataclass(frozen=True)
class Pair:
    """One number of both: ``change``: second over first less one, or their difference where a share means nothing.

    ``p``: probability of such a difference by noise alone, NaN where that is not known.
    """

    name: str
    unit: str
    a: Figure | None
    b: Figure | None
    change: float
    is_share: bool
    p: float
    verdict: Verdict


@dataclass(frozen=True)
class Joint:
    """All shared numbers at once: chi-square of their differences, degrees of freedom and its probability."""

    chi2: float
    freedom: int
    p: float


def figures_of(s: Source) -> list[Figure]:
    """The numbers of a calibration, a diagnosis or a placement.

    Raises
    ------
    TypeError, ValueError
        Something else stands where a number should, or one that nothing of ours has.
    """
    found = _figures(s)
    for f in found:
        numbers = [v for v in (f.value, f.low, f.high) if v is not None]
        if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in (*numbers, f.sd, f.freedom)):
            raise TypeError(f.name)
        if not all(isinstance(text, str) for text in (f.name, f.unit, f.variable)):
            raise TypeError(f.name)
        # NaN fails too. A standard deviation that is not known is NaN.
        if not all(abs(v) <= LARGEST for v in numbers) or abs(f.sd) > LARGEST or not f.freedom > 0.0 or f.sd < 0.0:
            raise ValueError(f.name)
    return found


def _figures(s: Source) -> list[Figure]:
    if s.kind == "placement":
        return _placement(s.content)
    if s.kind == "diagnosis":
        return [*_springs(s.content.get("springs", {})), *_effects(s.content)]
    if s.content:
        stages = s.content.get("stages", [])
        found = {n["name"]: _estimate(n) for one in stages for n in one.get("numbers", [])}
        return list(found.values()) or _springs(s.content.get("springs", {}))
    u = _uncertainty(s)
    return [] if u is None else _described(u)


def _uncertainty(s: Source) -> CalibrationUncertainty | None:
    model = s.model
    return None if model is None or model.calibration is None else model.calibration.uncertainty


def _estimate(n: Mapping[str, Any]) -> Figure:
    low, high = n["interval95"]
    sd = n.get("sd_of_variable")
    return Figure(
        n["name"],
        n["unit"],
        n["value"],
        low,
        high,
        n.get("variable", "value"),
        math.nan if sd is None else float(sd),
        float(n.get("degrees_of_freedom") or math.inf),
    )


def _springs(springs: Mapping[str, Any]) -> list[Figure]:
    out = []
    for joint, one in springs.items():
        low, high = one["interval95_Nm_per_rad"]
        out.append(_by_interval(f"{joint}.stiffness", "N m/rad", one["k_Nm_per_rad"], low, high, "1/value"))
    return out


def _by_interval(
    name: str, unit: str, value: float | None, low: float | None, high: float | None, variable: str = "value"
) -> Figure:
    """A number whose interval tells how well it is known."""
    sd = math.nan
    if value is not None and low is not None and high is not None:
        ends = (1.0 / low, 1.0 / high) if variable == "1/value" and low > 0.0 and high > 0.0 else (low, high)
        sd = abs(ends[1] - ends[0]) / (2.0 * NORMAL_95)
    return Figure(name, unit, value, low, high, variable, sd)


def _effects(content: Mapping[str, Any]) -> list[Figure]:
    out = []
    for one in (*content.get("effects", []), *content.get("learned", []), *content.get("provisional", [])):
        for name, p in one["parameters"].items():
            low, high = p["interval95"] or (None, None)
            out.append(
                replace(
                    _by_interval(f"{one['code']}.{name}", p["unit"], p["value"], low, high),
                    sd=math.nan if p["sd"] is None else float(p["sd"]),
                )
            )
    return out


def _placement(content: Mapping[str, Any]) -> list[Figure]:
    out = []
    rows = content.get("placements", [])
    # By their names in files of version 1.
    rows = [{"placement": name, **one} for name, one in rows.items()] if isinstance(rows, dict) else rows
    for one in rows:
        for key, value in one.items():
            if not isinstance(value, int | float):
                continue
            ends = (("_N_per_mm", "N/mm"), ("_um", "um"), ("_deg", "deg"), ("", ""))
            end, unit = next((end, unit) for end, unit in ends if key.endswith(end))
            interval = one.get(f"{key.removesuffix(end)}_interval95{end}", one.get(f"{key}_95"))
            low, high = interval if isinstance(interval, list) and len(interval) == 2 else (None, None)
            out.append(_by_interval(f"{one['placement']}.{key}", unit, float(value), low, high))
    return out


def _described(u: CalibrationUncertainty) -> list[Figure]:
    """Numbers of a model file, with their standard deviations."""
    out = []
    for k, (name, unit, variable) in enumerate(zip(u.parameters, u.unit, u.variable, strict=True)):
        value, low, high = u.interval95(k)
        out.append(
            Figure(
                name,
                unit,
                None if u.status[k] == "not identified" else value,
                low,
                high if math.isfinite(high) else None,
                variable,
                math.sqrt(u.covariance[k][k]),
                u.degrees_of_freedom[k],
            )
        )
    return out + [Figure(n.name, n.unit, None, n.low, n.high) for n in u.undetermined]


def pairs(first: Sequence[Figure], second: Sequence[Figure]) -> list[Pair]:
    """Both lists side by side by name; numbers that only one has come last."""
    a, b = ({_name(f.name): replace(f, name=_name(f.name)) for f in some} for some in (first, second))
    both = [_pair(a[name], b[name]) for name in a if name in b]
    alone = [_alone(f, None) for name, f in a.items() if name not in b]
    alone += [_alone(None, f) for name, f in b.items() if name not in a]
    return [*_judged(both), *alone]


def _name(name: str) -> str:
    """One name of a spring about a joint's axis, which has two."""
    place, _, row = name.rpartition(".")
    return f"{place}.stiffness" if row == "rz" and place not in ("base", "tool") else name


def _alone(a: Figure | None, b: Figure | None) -> Pair:
    own = a or b
    assert own is not None  # noqa: S101 - one of the two
    return Pair(own.name, own.unit, a, b, math.nan, False, math.nan, "other")


def _pair(a: Figure, b: Figure) -> Pair:
    if a.unit != b.unit:
        return Pair(a.name, f"{a.unit} and {b.unit}", a, b, math.nan, False, math.nan, "other")
    change, is_share = math.nan, False
    if a.value is not None and b.value is not None:
        is_share = a.value > 0.0 and b.value > 0.0
        change = b.value / a.value - 1.0 if is_share else b.value - a.value
    p, verdict = math.nan, _by_ends(a, b)
    sd = math.hypot(a.sd, b.sd)
    if math.isfinite(sd) and math.isfinite(a.inner - b.inner) and a.variable == b.variable:
        size = max(abs(a.inner), abs(b.inner), 1e-300)
        if sd > EXACT * size:
            freedom = sd**4 / max(a.sd**4 / a.freedom + b.sd**4 / b.freedom, 1e-300)
            p = float(2.0 * t.sf(abs(b.inner - a.inner) / sd, min(freedom, 1e6)))
        else:
            p = 1.0 if abs(b.inner - a.inner) <= EXACT * size else 0.0
    return Pair(a.name, a.unit, a, b, change, is_share, p, verdict)


def _by_ends(a: Figure, b: Figure) -> Verdict:
    """Of numbers without a standard deviation: beyond the noise only where their intervals do not touch."""
    ends = [(-math.inf if f.low is None else f.low, math.inf if f.high is None else f.high) for f in (a, b)]
    if all(not math.isfinite(x) for pair in ends for x in pair):
        return "undecided"
    apart = ends[0][1] < ends[1][0] or ends[1][1] < ends[0][0]
    return "beyond the noise" if apart else "undecided"


def _judged(some: Sequence[Pair]) -> list[Pair]:
    """Verdicts of all together: of twenty numbers one differs by chance."""
    known = sorted((k for k, one in enumerate(some) if math.isfinite(one.p)), key=lambda k: some[k].p)
    out, still = list(some), True
    for rank, k in enumerate(known):
        still = still and some[k].p <= LEVEL / (len(known) - rank)
        verdict: Verdict = "beyond the noise" if still else "perhaps" if some[k].p <= LEVEL else "within the noise"
        out[k] = replace(some[k], verdict=verdict)
    return out


def joint(a: Source, b: Source) -> Joint | None:
    """All numbers that both determine, at once, by their covariances; None where these are not stored."""
    u, v = _uncertainty(a), _uncertainty(b)
    if u is None or v is None:
        return None
    theirs = [_name(name) for name in v.parameters]
    rows = [
        (i, theirs.index(_name(name)))
        for i, name in enumerate(u.parameters)
        if _name(name) in theirs
        and u.variable[i] == v.variable[theirs.index(_name(name))]
        and "not identified" not in (u.status[i], v.status[theirs.index(_name(name))])
    ]
    if not rows:
        return None
    i, j = (np.array(column) for column in zip(*rows, strict=True))
    d = np.array(v.estimate)[j] - np.array(u.estimate)[i]
    V = np.array(u.covariance)[np.ix_(i, i)] + np.array(v.covariance)[np.ix_(j, j)]
    sd = np.sqrt(np.diag(V))
    good = sd > 0.0
    if not good.any():
        return None
    z, R = d[good] / sd[good], (V / np.outer(np.maximum(sd, 1e-300), np.maximum(sd, 1e-300)))[np.ix_(good, good)]
    values, vectors = np.linalg.eigh(R)
    told = values > EXACT * values.max()
    square = float(np.sum((vectors.T @ z)[told] ** 2 / values[told]))
    return Joint(square, int(told.sum()), float(chi2.sf(square, int(told.sum()))))
