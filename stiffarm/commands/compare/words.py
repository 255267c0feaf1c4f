"""What a comparison says."""

from __future__ import annotations

import numpy as np

from robots.quantities import percent, significant
from stiffarm.commands.compare.maps import Quantity
from stiffarm.commands.compare.numbers import LEVEL, Figure, Pair
from stiffarm.commands.compare.step import Compared, Setting

HEADS = ("parameter", "first", "second", "unit", "change", "verdict")
SETTING_HEADS = ("", "first", "second")
MAP_HEADS = (
    "quantity",
    "unit",
    "first, median",
    "second, median",
    "change, median",
    "5 % to 95 % of the points",
    "beyond the noise",
)


def figure(f: Figure | None) -> str:
    """A number with its interval."""
    if f is None:
        return "-"
    value = "not identified" if f.value is None else significant(f.value, 4)
    if f.low is None and f.high is None:
        return value
    if f.high is None:
        return f"{value} (at least {significant(f.low or 0.0)})"
    if f.low is None:
        return f"{value} (up to {significant(f.high)})"
    return f"{value} ({significant(f.low)} to {significant(f.high)})"


def change(p: Pair) -> str:
    """By how much the second differs."""
    if not np.isfinite(p.change):
        return "-"
    if not p.is_share:
        return f"{p.change:+.3g}"
    return f"{100 * p.change:+.1f} %" if p.change < 1.0 else f"{1.0 + p.change:.3g} times"


def verdict(p: Pair) -> str:
    """Whether it is beyond the noise, with the probability."""
    if p.verdict == "other":
        return "only the first has it" if p.b is None else "only the second has it"
    if not np.isfinite(p.p):
        return p.verdict
    return f"{p.verdict} (p {probability(p.p)})"


def probability(p: float) -> str:
    """A probability of noise alone: ``0.03``, ``< 0.001``."""
    return "< 0.001" if p < 1e-3 else f"{p:.2g}"


def row(p: Pair) -> tuple[str, ...]:
    """A line of the table."""
    return p.name, figure(p.a), figure(p.b), "" if p.unit == "1" else p.unit, change(p), verdict(p)


def setting_row(s: Setting) -> tuple[str, ...]:
    """A line of what is no number."""
    return s.name.replace("_", " "), s.a, s.b


def map_row(q: Quantity) -> tuple[str, ...]:
    """A line of a map's quantity."""
    good = np.isfinite(q.a) & np.isfinite(q.b) & np.isfinite(q.change)
    if not good.any():
        return q.label, q.unit, "-", "-", "-", "-", "-"
    scale, unit = (100.0, " %") if q.is_share else (1.0, "")
    low, middle, high = np.quantile(scale * q.change[good], [0.05, 0.5, 0.95])
    beyond = "-" if q.beyond is None else f"{percent(float(np.mean(q.beyond[good])))} of the points"
    return (
        q.label,
        q.unit,
        significant(float(np.median(q.a[good]))),
        significant(float(np.median(q.b[good]))),
        f"{middle:+.3g}{unit}",
        f"{low:+.3g} to {high:+.3g}{unit}",
        beyond,
    )


def headline(c: Compared) -> str:
    """The answer in a sentence."""
    if c.maps is not None:
        return _of_maps(c)
    shared = c.shared
    if not shared:
        return f"They have no {noun(c)} in common."
    beyond = c.beyond
    if not beyond:
        perhaps = [p.name for p in shared if p.verdict == "perhaps"]
        more = f" ({', '.join(perhaps[:4])} perhaps)" if perhaps else ""
        return f"None of {counted(c)} differs by more than noise{more}."
    top = max(beyond, key=lambda p: abs(p.change) if np.isfinite(p.change) else 0.0)
    most = f"most: {top.name}, {change(top)}"
    return f"{len(beyond)} of {counted(c)} differ{'s' * (len(beyond) == 1)} by more than noise; {most}."


def noun(c: Compared) -> str:
    """What is compared."""
    return "figure" if c.a.kind == "placement" else "parameter"


def counted(c: Compared) -> str:
    """How many can be judged: ``5 parameters that both identify``."""
    count = sum(p.verdict != "undecided" for p in c.shared)
    return f"{count} {noun(c)}s that both {'have' if c.a.kind == 'placement' else 'identify'}"


def _of_maps(c: Compared) -> str:
    assert c.maps is not None  # noqa: S101 - asked before
    q = c.maps.quantities[0]
    good = np.isfinite(q.change)
    if not good.any():
        return "No point has a value in both maps."
    scale, unit = (100.0, "%") if q.is_share else (1.0, q.unit)
    low, middle, high = np.quantile(scale * q.change[good], [0.05, 0.5, 0.95])
    text = (
        f"{q.label}: the second map differs from the first by {middle:+.3g} {unit} in the median, {low:+.3g} to "
        f"{high:+.3g} {unit} over nine tenths of {int(good.sum())} points"
    )
    text = text[0].upper() + text[1:]
    if q.beyond is not None:
        text += f"; at {percent(float(np.mean(q.beyond[good])))} of them by more than the uncertainty of both"
    return text + "."


def remarks(c: Compared) -> list[str]:
    """What else a reader must know."""
    out = list(c.notes)
    if c.joint is not None:
        real = "more than noise" if c.joint.p < LEVEL else "no more than noise"
        out.append(
            f"All {c.joint.freedom} shared parameters tested together, with their covariances: {real} (chi-square "
            f"{c.joint.chi2:.3g} on {c.joint.freedom} degrees of freedom, p {probability(c.joint.p)})."
        )
    differing = [s for s in c.settings if not s.same and s.name in ("load_path", "links", "scheme", "cell")]
    out += [f"They differ in {s.name.replace('_', ' ')}: {s.a} and {s.b}." for s in differing]
    if c.maps is not None:
        out += [f"{text[0].upper()}{text[1:]}." for text in c.maps.remarks]
        for count, which in ((c.maps.only_a, "first"), (c.maps.only_b, "second")):
            if count:
                out.append(f"{count} point{'s are' if count > 1 else ' is'} reached in the {which} map only.")
        if all(q.beyond is None for q in c.maps.quantities):
            out.append(
                "Only maps of a calibrated model hold an uncertainty: without that of both, differences cannot be "
                "judged against it."
            )
    return out
