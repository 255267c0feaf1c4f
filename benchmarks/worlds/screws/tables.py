"""Measurement tables and model files as text: what the diagnosis may see."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

import numpy as np

from .campaign import Campaign, heated
from .mechanics import situation
from .screws import Array
from .truth import Truth

SHOWN = ("dx_mm", "dy_mm", "dz_mm")


def model_text(t: Truth) -> str:
    """The arm's description with nominal springs; a joint that the model holds rigid has no entry."""
    out: list[str] = []
    joint = -1
    path = "serial" if t.model_path == 0.0 else "parallelogram"
    for line in t.arm.text.splitlines():
        if line.startswith("name = ") and joint < 0:
            line = f'name = "{t.arm.name}-as-known"'
        elif line.startswith("load_path = "):
            line = f'load_path = "{path}"'
        joint += line == "[[joint]]"
        if line.startswith("stiffness = "):
            continue
        out.append(line)
        if line.startswith("limits = ") and joint in t.free and len(out) > 1 and _in_joint(out):
            k = float(t.nominal[joint])
            out.append(f'stiffness = {{ value = {k!r}, unit = "N m/rad", source = "assumed" }}')
    return "\n".join(out) + "\n"


def _in_joint(lines: Sequence[str]) -> bool:
    """Whether the last line stands in a joint's table (limits also stand in couplings)."""
    heads = [line for line in lines if line.startswith("[")]
    return bool(heads) and heads[-1] == "[[joint]]"


def thermometer(t: Truth, c: Campaign, rng: np.random.Generator) -> Array | None:
    """Temperature (n,) in C as the set's thermometer shows it, to a tenth."""
    if t.design.thermometer == "none":
        return None
    seen = c.air_celsius + rng.normal(scale=0.1, size=len(c))
    if t.design.thermometer == "housing":
        seen = seen + 12.0 * heated(c, np.ones(len(c)), 5400.0)
    return np.round(seen, 1)


def rows_of(t: Truth, c: Campaign, d: Array, warm: Array | None, labels: bool) -> Iterable[dict[str, str]]:
    """Rows of a table, in the order of the campaign; ``d`` (n, 3) in m; order and clock if ``labels``."""
    for i in range(len(c)):
        row = {name: f"{v:g}" for name, v in zip(t.arm.coordinates, c.q_deg[i], strict=True)}
        row |= {name: f"{v + 0.0:g}" for name, v in zip(("fx_N", "fy_N", "fz_N"), c.force[i], strict=True)}
        if c.point[i].any():
            row |= {n: f"{1e3 * v:g}" for n, v in zip(("px_mm", "py_mm", "pz_mm"), c.point[i], strict=True)}
        row |= {SHOWN[axis]: f"{1e3 * d[i, axis]:.6g}" for axis in t.axes}
        row["pose"] = str(c.setup[i] + 1)
        if labels:
            row |= {"repeat": str(c.repeat[i]), "phase": "unloading" if c.unloading[i] else "loading"}
            row |= {"step": str(i + 1), "time_s": f"{c.time_s[i]:.1f}"}
            if warm is not None:
                row["temperature_C"] = f"{warm[i]:.1f}"
            if t.design.sessions > 1:
                row["session"] = f"day-{c.session[i] + 1}"
        yield row


def text_of(rows: Iterable[dict[str, str]]) -> str:
    """Rows as CSV text; columns are the first row's."""
    rows = list(rows)
    out = io.StringIO()
    writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def shown(t: Truth, clean: Array, c: Campaign, rng: np.random.Generator) -> tuple[Array, int]:
    """Readings (n, 3) in m with scatter of the set-ups, noise, outliers and rounding; how many outliers."""
    names, stay = np.unique(c.stay, return_inverse=True)
    moved = clean * (1.0 + t.design.scatter * rng.normal(size=len(names))[stay])[:, None]
    full = float(np.linalg.norm(t.campaign.force, axis=1).max())
    own = t.instrument.covariance(clean, situation(t.built, (), c).point, c.force, full)
    out = moved + t.instrument.noise(rng, own, c.session)
    if not t.design.outliers:
        return t.instrument.rounded(out), 0
    bad = np.flatnonzero(rng.random(len(c)) < 0.02)
    for i in bad.tolist():
        axis = int(rng.choice(t.axes))
        kind = int(rng.integers(4))
        sigma = float(np.sqrt(own[i, axis, axis]))
        wrong = [out[i, axis] + rng.choice([-1, 1]) * rng.uniform(5, 15) * sigma] * 2
        wrong += [out[i, axis] * float(rng.choice([10.0, 0.1])), -out[i, axis]]
        out[i, axis] = wrong[kind]
    return t.instrument.rounded(out), len(bad)
