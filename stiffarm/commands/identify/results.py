"""What an identification of joint twists says: stiffnesses, how sure they are, hysteresis, checks, the map."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from doe.joint_twists import Direction, Identified, LawKind
from doe.joint_twists.checks import BendingRatio, DiagonalTest, Loop
from doe.joint_twists.flange import POSES, AtFlange, HeldOut
from doe.joint_twists.identify import KINDS, NO_NOISE
from doe.joint_twists.laws import Law
from doe.joint_twists.model_file import held_constant, rms_mm
from doe.joint_twists.substitute import Window
from fem.arm import Arm
from fem.statics.ports import ROWS
from robots import save_description
from robots.arrays import Array
from robots.constants import NORMAL_95
from robots.files.csv_text import columns_parts
from robots.quantities import Quantity, angle, length, relative, rounded, rounded_all, stiffness
from stiffarm.pages.report import KeyFigure, Section, Text, data_words
from stiffarm.result import Drawing, Number, Result, Table, plain
from stiffarm.session.caution import caveats
from stiffarm.session.outputs import OutputFolder

SYNTHETIC: Final = "The readings are synthetic: simulated from known stiffnesses, not measured."
# What a status means for the numbers that are missing.
STATUS: Final = {
    "not identified": "never loaded or never read",
    "not determined": "the best compliance is not positive: a lower limit at most",
    "not judged": NO_NOISE,
    "one-sided": "no upper limit: rigid is possible within 95 %",
}
# Why a number is null, by its key.
WHY_NULL: Final = {
    "left_out_scores": "without one of the angles this law does not settle",
    "covariance": NO_NOISE,
    "hysteresis": "nothing was read to move under the load, or nothing tells the noise",
    "cross_terms": "the diagonal entries or the noise are zero to the last digit: nothing to compare with",
    "noise": "not read without a standard deviation of its own (sigma_mm, sigma_twist_mrad), or " + NO_NOISE,
    "scatter_of_set_ups": "too few set-ups at one angle",
    "flange_errors": "at some poses the model compared is rigid along this axis",
    "gears_refitted_Nm_per_rad": "forces at the flange centre do not turn this joint",
    "half_interval_percent": "some stiffnesses have no interval, or no upper limit",
    "twist_ratio": "needs rx and rz of the second joint, both determined",
    "held_out": "no flange deflections were given (--holdout), or the stiffnesses give no finite value there",
}
# In the unit that its row names, as joints shift and turn.
STIFFNESS, WIDTH = Quantity("stiffness"), Quantity("width", factor=1e6)
SIX: Final = tuple(Quantity(row, "N/um", 1e-6, digits=3) for row in ROWS[:3]) + tuple(
    Quantity(row, "1e6 N m/rad", 1e-6, digits=3) for row in ROWS[3:]
)
NOISE: Final = length("displacement_noise", unit="um"), Quantity("rotation_noise", "urad", 1e6)


def share(key: str) -> Quantity:
    """A share or a relative error, shown in percent."""
    return Quantity(key, "%", 100.0, key.replace("_", " "), digits=3)


@dataclass(frozen=True, eq=False)
class Identification:
    """A finished identification with its checks and comparisons; ``arm``: the one with six springs at every joint.

    ``flange``, ``window``: the comparison at the flange and the map; in their place why there is none.
    """

    arm: Arm
    found: Identified
    loops: tuple[Loop, ...]
    diagonal: tuple[DiagonalTest, ...]
    bending: BendingRatio | None
    flange: AtFlange | str
    window: Window | str
    held_out: HeldOut | None


def result(d: Identification, law: LawKind | None, write: Callable[[OutputFolder], None] | None) -> Result:
    """Everything about an identification.

    ``law``: the one asked for, None where each was chosen; ``write``: writes the files of a simulated campaign.
    """
    found, data = d.found, d.found.data
    status = [x.status for x in found.directions.values()]
    tables = (_six(found), *_tables(d))
    made = " ".join(filter(None, (SYNTHETIC if data.synthetic else "", caveats(d.arm))))
    window = None if isinstance(d.window, str) else _map_table(d.window)

    def more(folder: OutputFolder) -> Mapping[str, Any]:
        save_description(d.arm.description, folder.path("model.toml"))
        if window is not None:
            folder.write_parts("stiffness_map.csv", columns_parts(window.columns()))
        if write is not None:
            write(folder)
        return {}

    return Result(
        name="identify",
        title=d.arm.description.title.split(" (")[0] + (" - synthetic data" if data.synthetic else ""),
        question="how stiff is each joint, in all six directions?",
        answer=f"Of {len(status)} stiffnesses, "
        + ", ".join(f"{status.count(s)} {'are' if status.count(s) > 1 else 'is'} {s}" for s in dict.fromkeys(status))
        + f", from {data.n} {'synthetic ' if data.synthetic else ''}readings.",
        how_sure=_scatter_words(found),
        what_next=_next(found),
        facts=_facts(d),
        numbers={length("left_over_rms"): Number(1e-3 * rms_mm(found))},
        tables=tables,
        drawings=tuple(_drawings(d)),
        key=tuple(_key(d)),
        sections=(_how(d, law),),
        remarks=tuple(_remarks(d)),
        arm=d.arm,
        caution=made,
        found=d,
        more=more,
        made_of=data_words(data),
    )


def _facts(d: Identification) -> dict[str, Any]:
    found, data, f, w = d.found, d.found.data, d.flange, d.window
    none_there = {"at_flange": f, "map": w}
    return {
        "robot": found.robot,
        "synthetic": data.synthetic,
        "data": data.source,
        "data_sha256": data.sha256,
        "readings": data.n,
        "load_cycles": found.cycles.m,
        "set_ups": len(found.cycles.setups),
        "branches": found.branches,
        "cannot_judge": [{"what": x.what, "of": list(x.of), "reason": x.reason} for x in found.unjudged],
        "laws": [_law(x) for x in found.directions.values()],
        "scatter_of_set_ups": {
            kind: {"percent": rounded(100.0 * s) if n else None, "freedoms": n}
            for kind, s, n in zip(KINDS, found.scatter, found.scatter_dof, strict=True)
        },
        "twist_ratio": None
        if d.bending is None
        else {
            "joint": d.bending.joint,
            "rx_over_rz": rounded(d.bending.ratio),
            "interval95": rounded_all((d.bending.low, d.bending.high)),
        },
        "at_flange": None
        if isinstance(f, str)
        else {
            "half_interval_percent": plain(f.spread, 100.0),
            "gears_refitted_Nm_per_rad": [None if c == 0.0 else rounded(1.0 / c, 12) for c in f.effective.tolist()],
        },
        "map": None
        if isinstance(w, str)
        else {
            "flange": w.orientation,
            "elbow": w.elbow,
            "x_mm": [1e3 * float(w.x[0]), 1e3 * float(w.x[-1])],
            "z_mm": [1e3 * float(w.z[0]), 1e3 * float(w.z[-1])],
            "reached_percent": 100.0 * float(np.isfinite(w.mean).mean()),
            "mean_stiffness_N_per_mm": [1e-3 * float(np.nanmin(w.mean)), 1e-3 * float(np.nanmax(w.mean))],
        },
        "why_null": STATUS | WHY_NULL | {key: one for key, one in none_there.items() if isinstance(one, str)},
    } | ({"held_out": None} if d.held_out is None else {})


def _law(d: Direction) -> dict[str, Any]:
    law: Law | None = d.law
    scores = {kind: rounded(score, 12) for kind, score in d.scores.items()}
    out = {"joint": d.joint, "row": d.row, "status": d.status, "left_out_scores": scores}
    if law is None:
        return out
    covariance = [[rounded(v, 17) for v in row] for row in law.covariance.tolist()]
    return out | {"kind": law.kind, "ln_k_coefficients": law.coefficients.tolist(), "covariance": covariance}


def _six(found: Identified) -> Table:
    """For people: a row a joint, six stiffnesses at the middle of the angles measured."""
    k = np.array([_at_middle(found.directions[name, row]) for name in found.names for row in ROWS])
    values, low, high = k.reshape(-1, 6, 3).transpose(2, 1, 0)
    return Table(
        "six",
        "Six stiffnesses of each joint at the middle of the angles measured",
        {"joint": found.names},
        dict(zip(SIX, values, strict=True)),
        {q: (low[i], high[i]) for i, q in enumerate(SIX)},
        is_extract=True,
    )


def _at_middle(d: Direction) -> tuple[float, ...]:
    middle = (d.angle.min() + d.angle.max()) / 2.0 if d.angle.size else 0.0
    return tuple(float(v[0]) for v in d.stiffness(np.array([middle])))


def _tables(d: Identification) -> Iterator[Table]:
    """All other tables, the stiffnesses first."""
    found, c = d.found, d.found.cycles
    rows = [(x, a) for x in found.directions.values() for a in (x.angle if x.angle.size else [np.nan])]
    k, low, high = np.array([[float(v[0]) for v in x.stiffness(np.array([a]))] for x, a in rows]).T
    yield Table(
        "stiffnesses",
        "Six stiffnesses of each joint at the angles measured",
        {
            "joint": [x.joint for x, _ in rows],
            "row": [x.row for x, _ in rows],
            "status": [x.status for x, _ in rows],
            "law": [x.law.kind if x.law else "" for x, _ in rows],
            "unit": [x.unit for x, _ in rows],
            "data": ["synthetic" if found.data.synthetic else found.data.source] * len(rows),
        },
        {angle("angle"): np.array([a for _, a in rows]), STIFFNESS: k},
        {STIFFNESS: (low, high)},
        folded=True,
    )
    yield from _held_out(d.held_out)
    if d.loops:
        yield _hysteresis(d.loops)
    couplings = [(t, x) for t in d.diagonal for x in sorted(t.couplings, key=lambda x: x.p_value)]
    if couplings:
        yield Table(
            "cross_terms",
            "Does a load in one direction cause motion in another?",
            {
                "joint": [t.joint for t, _ in couplings],
                "rows": ["-".join(x.rows) for _, x in couplings],
                "proven": [x.proven for _, x in couplings],
                "diagonal_is_enough": [t.suffices for t, _ in couplings],
            },
            {
                Quantity("share", label="share of the diagonal", digits=2): np.array([x.share for _, x in couplings]),
                Quantity("p_value", digits=2): np.array([x.p_value for _, x in couplings]),
            },
            folded=True,
        )
    if not isinstance(d.flange, str):
        models = {"gears, same stiffness": d.flange.same, "gears, refitted": d.flange.refitted}
        models |= {"constants of model.toml": d.flange.file}
        yield Table(
            "flange_errors",
            f"Errors of directional stiffness against six stiffnesses a joint, {POSES} random poses",
            {"model": [name for name in models for _ in "xyz"], "axis": list("xyz") * len(models)},
            {
                share(name): np.concatenate([getattr(e, name) for e in models.values()])
                for name in ("bias", "mean", "p95", "worst")
            },
        )
    known = np.where(c.noise_dof > 0, c.noise, np.nan)
    yield Table(
        "noise",
        "Noise of one reading, estimated where the table gives none",
        {"joint": found.names},
        dict(zip(NOISE, known.T, strict=True))
        | {Quantity(f"{q.key}_freedoms"): n.astype(np.float64) for q, n in zip(NOISE, c.noise_dof.T, strict=True)},
        folded=True,
    )


def _held_out(h: HeldOut | None) -> Iterator[Table]:
    if h is None:
        return
    predicted = stiffness("predicted")
    yield Table(
        "held_out",
        "Held-out flange deflections",
        {"pose": h.labels},
        {
            Quantity("force", "N"): h.force,
            stiffness("measured"): h.measured,
            predicted: h.predicted,
            share("error"): h.error,
        },
        {predicted: (h.low, h.high)},
    )


def _hysteresis(some: tuple[Loop, ...]) -> Table:
    width, half = np.array([(x.width, NORMAL_95 * x.spread) for x in some]).T
    return Table(
        "hysteresis",
        "Hysteresis: unloading minus loading at the same load (one in twenty is proven by chance)",
        {
            "joint": [x.joint for x in some],
            "row": [x.row for x in some],
            "proven": [x.proven for x in some],
            "unit": ["um" if x.row.startswith("t") else "urad" for x in some],
        },
        {
            WIDTH: width,
            share("share_of_range"): np.array([x.share for x in some]),
            share("stiffness_from_loading_only"): np.array([x.loading_only for x in some]),
            Quantity("load_cycles"): np.array([float(x.cycles) for x in some]),
        },
        {WIDTH: (width - half, width + half)},
        folded=True,
    )


def _map_table(w: Window) -> Table:
    """One row a point of the map; a file of its own."""
    values = {stiffness(f"k{a}"): w.stiffness[..., i].ravel() for i, a in enumerate("xyz")}
    return Table(
        "stiffness_map",
        "Stiffness map",
        {},
        {length("x"): np.tile(w.x, len(w.z)), length("z"): np.repeat(w.z, len(w.x))}
        | values
        | {stiffness("mean"): w.mean.ravel()},
    )


def _drawings(d: Identification) -> Iterator[Drawing]:
    from stiffarm.commands.identify import figures

    def drawing(name: str, caption: str, alt: str, draw: Callable[..., Any], *of: Any) -> Drawing:
        return Drawing(name, caption, alt, partial(draw, *of))

    found = d.found
    yield drawing(
        "compliances",
        "Compliances side by side. n.i.: never loaded or never read; n.d.: the best compliance is not positive.",
        "six compliances of every joint",
        figures.compliances_figure,
        found,
    )
    yield drawing(
        "stiffness_over_angle",
        "Each stiffness over its joint's angle. Points: each angle by itself, without a law. Where a band is wider "
        "than the axis, the readings hardly depend on this stiffness. Laws hold between the outermost angles.",
        "six stiffnesses of every joint over its angle",
        figures.laws_figure,
        found,
    )
    if any(x.row == "rz" for x in d.loops):
        yield drawing(
            "hysteresis",
            "Loading and unloading about the gear axes.",
            "twist over torque",
            figures.loops_figure,
            found,
        )
    if not isinstance(d.flange, str):
        yield drawing(
            "gears_alone",
            "Error of directional stiffness by flange axis. In the worst poses the force has no lever arm about any "
            "gear axis, so that a model of the gears alone is practically rigid.",
            "errors of models of the gears alone",
            figures.usual_models_figure,
            d.flange.same,
            d.flange.refitted,
        )
    if not isinstance(d.window, str):
        yield drawing(
            "stiffness_map",
            "Mean of the directional stiffnesses along flange X, Y and Z, each under a unit force in that direction. "
            "Figures: stiffness_map.csv.",
            "stiffness over a window of the plane Y = 0",
            figures.window_figure,
            d.window,
            found.robot,
        )


def _key(d: Identification) -> Iterator[KeyFigure]:
    status = [x.status for x in d.found.directions.values()]
    yield KeyFigure(f"{status.count('determined')} of {len(status)}", "stiffnesses determined")
    if not isinstance(d.flange, str):
        spread = float(d.flange.spread.max())
        shown = f"± {relative(spread)}" if np.isfinite(spread) else "none"
        yield KeyFigure(shown, "95 % interval of directional stiffness, median pose")
        gears = relative(float(d.flange.same.mean.max()))
        yield KeyFigure(gears, "mean error with gear stiffness alone, worst flange axis")
    if d.held_out is not None:
        yield KeyFigure(relative(float(np.abs(d.held_out.error).max())), "largest error at held-out readings")


def _next(found: Identified) -> str:
    unsure = [f"{x.joint}.{x.row}" for x in found.directions.values() if x.status != "determined"]
    named = ", ".join(unsure[:6]) + (f" and {len(unsure) - 6} more" if len(unsure) > 6 else "")
    more = f"Not fully determined: {named}. Add readings that load these directions. " if unsure else ""
    return f"{more}Use model.toml in other commands: `stiffarm map`, `posture`, `place`."


def _scatter_words(found: Identified) -> str:
    parts = [
        f"{relative(s)} ({kind})" if n else f"not known ({kind}: too few set-ups at one angle)"
        for kind, s, n in zip(KINDS, found.scatter, found.scatter_dof, strict=True)
    ]
    return f"Compliances of set-ups at the same angle scatter, beyond reading noise, by {' and '.join(parts)}."


def _remarks(d: Identification) -> Iterator[str]:
    """What a reader must know, in sentences."""
    yield from d.found.data.notes
    yield from d.found.notes
    proven = [x for x in d.loops if x.proven and x.row == "rz"]
    if proven:
        most = max(proven, key=lambda x: abs(x.share))
        yield (
            f"hysteresis about the gear axes of {', '.join(x.joint for x in proven)}, at most {relative(most.share)} "
            f"of the range ({most.joint}); loading alone would change that gear's stiffness by "
            f"{relative(most.loading_only)}"
        )
    if d.found.branches == "loading":
        yield "only loading was used, so the stiffnesses include friction"
    bad = [t.joint for t in d.diagonal if not t.suffices]
    if bad:
        yield f"a diagonal stiffness matrix is not enough at {', '.join(bad)}: cross terms are proven"
    elif d.diagonal:
        where = "" if len(d.diagonal) == len(d.found.names) else f" at {', '.join(t.joint for t in d.diagonal)}"
        yield (
            f"a diagonal stiffness matrix per joint is enough{where}: no cross term is both proven and above a tenth "
            "of the diagonal"
        )
    else:
        yield "cross terms cannot be tested: at no joint are two stiffnesses identified"
    for none_there in (d.flange, d.window):
        if isinstance(none_there, str):
            yield none_there if none_there is d.flange else f"no map: {none_there}"
    constant = held_constant(d.found)
    yield from constant
    if isinstance(d.flange, str):
        return
    yield (
        f"a model of the gears alone is off by {_each(d.flange.same.mean)} on average in flange X, Y, Z; refitted to "
        f"flange deflections, by {_each(d.flange.refitted.mean)}"
    )
    if constant:
        yield (
            f"compared with the laws, these constants change the stiffness by {_each(d.flange.file.mean)} on average "
            f"in flange X, Y, Z, at worst {_each(d.flange.file.worst)}"
        )


def _each(values: Array) -> str:
    return ", ".join(relative(float(v)) for v in values)


def _how(d: Identification, law: LawKind | None) -> Section:
    """How it was done."""
    laws = [x for x in d.found.directions.values() if x.law]
    better = sum(bool(x.scores) and min(x.scores, key=lambda k: x.scores[k]) != "constant" for x in laws)
    chosen = (
        f"Law of every stiffness over the joint angle, as asked: {law}."
        if law is not None
        else "Each law of ln k over the joint angle has the highest order that its angles can support (order one from "
        "four angles on, order two from six over half a turn), so that the interval does not rest on the stiffness "
        f"being constant or varying only once a turn. For {better} stiffnesses a varying law predicts left-out angles "
        "better than a constant."
    )
    used = "the mean of loading and unloading" if d.found.branches == "mean" else "loading alone"
    ratio = (
        ""
        if d.bending is None
        else (
            f" The same moment twists joint {d.bending.joint} about X by {d.bending.ratio:.2f} ({d.bending.low:.2f} to "
            f"{d.bending.high:.2f}) times as much as about the gear axis."
        )
    )
    texts = (
        "Frame: the modified DH frame of the joint, with Z along the gear axis and X along the common normal to the "
        "next axis; it turns with the link after the joint.",
        "Statics gives force and moment at each joint from those at the flange. Each load cycle gives one slope per "
        f"direction, from {used}; the cycles of a set-up give its compliance by weighted least squares; the law over "
        "the angle is fitted to the set-ups, whose scatter is estimated by restricted likelihood from set-ups at the "
        "same angle. The links are rigid.",
        chosen,
        "Each of the 15 off-diagonal entries is fitted along with the laws and tested; “proven” means significant "
        "after correction for all entries of all joints (Holm). Shares are relative to the geometric mean of the two "
        "diagonal compliances. A bearing away from the origin of the DH frame shows up here, because its tilt moves "
        f"the origin.{ratio}",
        "Models of the gears alone have one stiffness per joint, about the gear axis: once with the same torsional "
        "stiffnesses, once with constants refitted to flange deflections at other random poses within limits and with "
        "the flange above the floor.",
    )
    return Section("How it was found", tuple(map(Text, texts)), folded=True)
