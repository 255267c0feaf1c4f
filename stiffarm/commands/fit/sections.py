"""Sections of a fit's report: what else an answer holds, other methods, how to ask."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.constants import NORMAL_95
from robots.inverse.singularities import NEAR_SINGULAR, singularity_distance
from robots.quantities import known_to, ranged, relative, significant
from stiffarm.commands.fit.words import KNOWN, half_width
from stiffarm.commands.query.answers import value_of
from stiffarm.pages.report import Block, Bullets, Note, Section, Table, Text
from surrogate import Surrogate, Trained, predict, query
from surrogate.asking import full_poses
from surrogate.error_bars import MATTERS
from surrogate.model import COMPLIANCE
from surrogate.portable.files import FORMATS
from surrogate.training import NOTHING

_NAMED = 12
_FILES = {
    "onnx": "as ONNX, for onnxruntime",
    "c": "as a C header without dependencies",
    "python": "as Python without packages",
    "javascript": "as JavaScript, for pages and Node",
}


@dataclass(frozen=True)
class Known:
    """What the calibration's uncertainty makes of the quantity over uniform poses: relative 95 % half-widths.

    ``open_share``: what the readings left open -> share of the poses at which it matters.
    """

    median: float
    p95: float
    own_median: float
    open_share: dict[str, float]


def known_by(trained: Trained) -> Known | None:
    """Summary over the uniform runs kept out; None where nothing is known of the parameters."""
    best, p = trained.best, trained.best.parameters
    if p is None or best.bars is None:
        return None
    Q = trained.held_out.Q[: trained.uniform]
    width = NORMAL_95 * p.relative_sd(Q, predict(best, Q))
    share = p.matters(Q).mean(axis=0)
    found = {name: float(v) for name, v in zip(p.undetermined, share, strict=True)}
    median, p95 = (float(v) for v in np.quantile(width, [0.5, 0.95]))
    return Known(median, p95, float(np.median(best.bars.half_width(Q))), found)


def answer_section(trained: Trained, known: Known | None) -> Section:
    """Calibration's part of the error bar, inputs, fixed coordinates, couplings, flags."""
    best = trained.best
    blocks: list[Block] = [*_calibration(best, known)]
    if any(best.periodic):
        names = [n for n, whole in zip(best.inputs, best.periodic, strict=True) if whole]
        blocks.append(Text(f"Whole turns of {', '.join(names)} make no difference and are removed before the fit."))
    if len(best.couplings.names):
        blocks.append(
            Bullets(tuple(f"Coupled limit {line}; other poses cannot be reached." for line in _couplings(best)))
        )
    blocks += _fixed(best)
    blocks.append(Text(_flags(trained)))
    if best.notes:
        blocks.append(Text(f"The runs came from a model with {', '.join(best.notes)}."))
    return Section("What else is in an answer", tuple(blocks))


def _calibration(best: Surrogate, known: Known | None) -> list[Block]:
    p = best.parameters
    if p is None or known is None:
        return [
            Text(
                "The error bars cover only the surrogate's own error, not the uncertainty of the model's parameters. "
                "For the stiffness, a model file written by calibrate or diagnose adds that uncertainty."
            )
        ]
    named = ", ".join(p.names[:_NAMED]) + (f" and {len(p.names) - _NAMED} more" if len(p.names) > _NAMED else "")
    blocks: list[Block] = [
        Text(
            f"The calibration's uncertainty ({named}) makes the {best.quantity.name} {half_width(known.median)} at "
            f"the median pose and {half_width(known.p95)} at the 95th percentile (95 % intervals, uniform poses); the "
            f"surrogate's own bar is {half_width(known.own_median)} at the median pose. The error bar of an answer is "
            "the root sum of squares of both. The calibration's part is itself a fit over the inputs, with an error of "
            f"{relative(p.misfit)} of its largest value."
        )
    ]
    open_words = [f"{name} at {relative(share)} of the poses" for name, share in known.open_share.items() if share > 0]
    if open_words:
        blocks.append(
            Note(
                f"The calibration did not identify parameters that may change the {best.quantity.name} by more than "
                f"{relative(MATTERS)}: {'; '.join(open_words)}. There the error bar is a lower bound, and the answer "
                "says so."
            )
        )
    elif known.open_share:
        blocks.append(Text(f"The calibration did not identify {', '.join(known.open_share)}; it matters nowhere here."))
    return blocks


def _couplings(best: Surrogate) -> list[str]:
    c = best.couplings
    out = []
    for name, factors, low, high in zip(c.names, c.matrix, np.degrees(c.lower), np.degrees(c.upper), strict=True):
        terms = " ".join(
            f"{'−' if f < 0 else '+'} {'' if abs(f) == 1.0 else f'{abs(f):g} '}{n.removesuffix('_deg')}"
            for f, n in zip(factors, best.inputs, strict=True)
            if f != 0.0
        ).removeprefix("+ ")
        out.append(f"{name.removesuffix('_deg')}: {terms} from {low:.6g} to {high:.6g} deg")
    return out


def _fixed(best: Surrogate) -> list[Block]:
    if not best.fixed_deg:
        return []
    rows = tuple(
        (
            name.removesuffix("_deg"),
            f"{value:g}",
            relative(best.fixed_influence[name]) if name in best.fixed_influence else "not known",
        )
        for name, value in best.fixed_deg.items()
    )
    table = Table(
        "Fixed coordinates",
        ("coordinate", "fixed at, deg", f"would change the {best.quantity.name} by up to"),
        rows,
    )
    if max(best.fixed_influence.values(), default=0.0) > NOTHING:
        return [table, Text("If one that matters moves on your arm, add it to --inputs.")]
    return [table]


def _flags(trained: Trained) -> str:
    text = "An answer is flagged where the pose is outside these ranges or cannot be reached (then it has no value)"
    best = trained.best
    if best.kinematics is None:
        return text + "."
    Q = trained.held_out.Q[: trained.uniform]
    sigma = singularity_distance(best.kinematics, full_poses(best.kinematics, best, Q)).sigma_min
    near = float(np.mean(sigma < NEAR_SINGULAR))
    return f"{text}, and where it is near a singularity: {relative(near)} of the uniform poses."


def usage_section(trained: Trained, formats: Sequence[str]) -> Section:
    """Commands, an example with its answer, the files."""
    best = trained.best
    pose, answer = _example(trained)
    commands = [
        ("one pose", f"stiffarm query surrogate.json --pose {pose}"),
        ("a table of poses, CSV or XLSX", "stiffarm query surrogate.json poses.csv --out answers"),
    ]
    if best.has_matrix:
        commands.append(
            ("another load direction (no error bar)", "stiffarm query surrogate.json poses.csv --direction 1,0,0")
        )
        commands.append(("the 6 x 6 compliance", "stiffarm query surrogate.json poses.csv --matrix"))
    if best.quantity.name == COMPLIANCE and np.allclose(best.load_direction, (0.0, 0.0, -1.0), atol=1e-9):
        commands.append(("a map over the joints", "stiffarm map joints MODEL --surrogate surrogate.json --out map"))
    commands.append(
        ("for other programs, with this fit's other options", "stiffarm fit MODEL --format onnx,c,python --out other")
    )
    blocks: list[Block] = [
        Table("Commands", ("for", "command"), tuple(commands), text_columns=(0, 1), code_columns=(1,))
    ]
    if answer:
        blocks.append(Text(answer))
    rows = [("surrogate.json", "the chosen surrogate, for query and map")]
    rows += [(FORMATS[name], _FILES[name]) for name in formats]
    rows += [(f"surrogate_{s.basis}.json", f"the surrogate with the {s.basis} basis") for s in trained.surrogates]
    blocks.append(Table("Files", ("file", "what it is"), tuple(rows), text_columns=(0, 1)))
    return Section("How to ask it", tuple(blocks))


def _example(trained: Trained) -> tuple[str, str]:
    """A pose kept out with a typical value, rounded, and what the surrogate answers there."""
    best = trained.best
    Q, value = trained.held_out.Q[: trained.uniform], trained.held_out.value[: trained.uniform]
    # Typical: neither the softest pose nor one where the load passes through the joints.
    typical = np.argsort(np.abs(np.log(value / np.median(value))), kind="stable")[0]
    degrees = np.round(np.degrees(Q[typical]), 1) + 0.0
    pose = ",".join(f"{n}={v:g}" for n, v in zip(best.inputs, degrees, strict=True))
    found = query(best, np.radians(degrees)[None], extrapolate=True)
    if not found.answered[0] or not np.isfinite(found.relative_error[0]):
        return pose, ""
    quantity, e = value_of(best), float(found.relative_error[0])
    what, number = quantity.name.replace("_", " "), quantity.factor * float(found.value[0])
    if e >= KNOWN:
        about = f"{significant(number, 1)} {quantity.unit}".rstrip()
        return pose, (
            f"The first gives about {about}, but the model's parameters are known so poorly that the 95 % interval "
            f"of this {what} is wider than ± half its value: do not rely on it."
        )
    ends = number / (1.0 + e), number / (1.0 - e)
    unit = f" {quantity.unit}" if quantity.unit else ""
    return (
        pose,
        f"The answer to the first: {what} {known_to(number, *ends)}{unit}, 95 % interval {ranged(*ends)}{unit}.",
    )
