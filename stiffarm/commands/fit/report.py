"""What a fit found: which basis was taken and why, how wrong it is and where, whether its error bars hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from fem.arm import Arm
from fem.statics.stated import at_load_entry
from robots.arrays import Array
from robots.quantities import Quantity, count, relative, rounded
from stiffarm.commands.fit.figures.bars import (
    LEVEL,
    MOST_SHOWN,
    JudgedBars,
    chance,
    error_bars_figure,
    error_over_inputs_figure,
    parts,
)
from stiffarm.commands.fit.figures.effects import HeldOut, surrogate_quality_figure
from stiffarm.commands.fit.figures.spread import spread_figure
from stiffarm.commands.fit.sections import Known, answer_section, known_by, usage_section
from stiffarm.commands.fit.words import KNOWN, LARGE, basis_words, choice_words, doubts, half_width, share_words
from stiffarm.commands.query.answers import surrogate_errors, value_of
from stiffarm.commands.query.command import Surrogate, inputs_table
from stiffarm.pages import report as page
from stiffarm.pages.report import Block, Bullets, KeyFigure, Note, Section, Text
from stiffarm.result import Drawing, Table
from stiffarm.session.outputs import OutputFolder
from surrogate import Surrogate as Learned
from surrogate import Trained, save_surrogate
from surrogate.model import COMPLIANCE
from surrogate.portable.files import FORMATS, portable, write_one
from surrogate.training import NOTHING


def fitted(
    arm: Arm, trained: Trained, remarks: Sequence[str] = (), formats: Sequence[str] = (), *, matrix: bool = False
) -> Surrogate:
    """The best surrogate of a training with what there is to know of it; its files in ``formats`` too."""
    bars, known, best = _judged(trained), known_by(trained), trained.best
    return Surrogate(
        name="fit",
        title=f"Surrogate of the {arm.description.title.split(' (')[0]}",
        question="which surrogate, and how far to trust it?",
        answer=_answer(best, known),
        how_sure=_how_sure(trained, known),
        what_next=_what_next(trained, known),
        facts=payload(trained),
        tables=(errors_table(trained), inputs_table(best)),
        drawings=(*_spread(trained), quality(trained), *_bars(trained, bars)),
        key=_key_figures(best, known),
        sections=(
            usage_section(trained, formats),
            _choice(trained),
            _honesty(bars[0]),
            _where(trained, bars),
            answer_section(trained, known),
        ),
        remarks=tuple(remarks),
        arm=arm,
        found=trained,
        more=partial(_write, trained, formats, matrix),
        learned=best,
    )


def _write(trained: Trained, formats: Sequence[str], matrix: bool, folder: OutputFolder) -> Mapping[str, Any]:
    save_surrogate(trained.best, folder.path("surrogate.json"))
    for one in trained.surrogates:
        save_surrogate(one, folder.path(f"surrogate_{one.basis}.json"))
    if formats:
        # The matrix is known to the factored basis, even where another is the best along the load.
        known = [one for one in trained.surrogates if one.has_matrix] if matrix else [trained.best]
        content = portable(known[0] if known else trained.best, matrix=matrix)
        for name in formats:
            write_one(content, folder.path(FORMATS[name]))
    return {"files": ["surrogate.json", *(FORMATS[name] for name in formats)]}


def payload(trained: Trained) -> dict[str, Any]:
    """All surrogates of a training, best first."""
    best, p = trained.best, trained.best.parameters
    bars = None
    if p is not None:
        bars = {"parameters": list(p.names), "undetermined": list(p.undetermined), "misfit": rounded(p.misfit)}
    return {
        "best": best.basis,
        "quantity": best.quantity.name,
        "whole_turns_do_not_matter": [n for n, p in zip(best.inputs, best.periodic, strict=True) if p],
        "fixed_coordinates_would_change_it_by": {n: rounded(v) for n, v in best.fixed_influence.items()},
        "calibration_uncertainty": bars,
        "surrogates": [surrogate_errors(s) for s in trained.surrogates],
        "not_fitted": dict(trained.refused),
    } | at_load_entry(best.at_load)


_COLUMNS = {
    count("terms"): "n_terms",
    count("runs"): "n_train",
    Quantity("rms", label="RMS", words=relative): "rms_relative",
    Quantity("p95", label="95 % below", words=relative): "p95_relative",
    Quantity("worst_uniform", label="worst, uniform", words=relative): "max_interior",
    Quantity("worst", label="worst, with limits", words=relative): "max_relative",
    Quantity("matrix", label="6 x 6 worst", words=relative): "matrix_max",
    Quantity("inside", label="inside bars", words=share_words): "coverage95",
    Quantity("condition", digits=1): "condition_number",
}


def errors_table(trained: Trained, of: str = "") -> Table:
    """Errors of every surrogate on runs kept out, the best first; ``of``: a model.

    "95 % below" and "worst, with limits" are over all these runs, "worst, uniform" over those not on joint limits.
    """
    errors = [s.errors for s in trained.surrogates]
    values = {
        column: np.array([np.nan if (v := getattr(e, name)) is None else float(v) for e in errors])
        for column, name in _COLUMNS.items()
    }
    caption = f"{of}: relative" if of else "Relative"
    caption += f" errors of the {trained.best.quantity.name} on runs kept out"
    return Table("errors", caption, {"basis": [s.basis for s in trained.surrogates]}, values, is_extract=True)


def _answer(best: Learned, known: Known | None) -> str:
    what = f"the {best.quantity.label} at any pose of {len(best.inputs)} joint coordinates"
    own = f"its own error is {relative(best.errors.rms_relative)} (RMS)"
    if known is None:
        return f"It gives {what}: {own}. The uncertainty of the model itself is not known."
    limits = "the calibration, not the surrogate," if known.median > best.errors.rms_relative else "the surrogate"
    return f"It gives {what}: {own}, and {limits} limits the accuracy of an answer."


def _key_figures(best: Learned, known: Known | None) -> tuple[KeyFigure, ...]:
    key = [
        KeyFigure(relative(best.errors.rms_relative), "own error (RMS, runs it has not seen)"),
        KeyFigure(relative(best.errors.max_relative), "own error, worst of these runs"),
        KeyFigure(share_words(best.errors.coverage95), "of these runs inside the 95 % error bars"),
    ]
    if known is not None:
        shown = f"± {relative(known.median)}" if known.median < KNOWN else "not known"
        key.insert(0, KeyFigure(shown, "95 % interval of an answer by the calibration, median pose"))
    return tuple(key)


def _how_sure(trained: Trained, known: Known | None) -> str:
    best = trained.best
    text = f"Judged on {len(trained.held_out.Q)} runs that neither the fit nor its error bars have seen."
    if known is None:
        return f"{text} The model has no calibration, so an answer is only as good as its springs."
    if known.median >= KNOWN:
        return (
            f"{text} But the readings behind the model do not determine the {best.quantity.name} to within half its "
            "size at the median pose, and no surrogate can make up for that."
        )
    return f"{text} The calibration makes an answer uncertain by {half_width(known.median)} at the median pose (95 %)."


def _what_next(trained: Trained, known: Known | None) -> str:
    best = trained.best
    if best.errors.rms_relative > LARGE:
        return f"Try more runs or another basis: `stiffarm fit MODEL --runs {4 * best.errors.n_train} --out more`."
    if known is None:
        return "Calibrate the model first: `stiffarm calibrate MODEL DATA --out calibrated`."
    if known.median >= KNOWN or any(known.open_share.values()):
        return "More readings would narrow the intervals: `stiffarm plan MODEL --poses 6` chooses them."
    return "Use it: `stiffarm query surrogate.json --pose ...`; the commands are below."


def _unit(learned: Learned) -> tuple[str, str]:
    """Axis label of what a surrogate answers, and its unit."""
    quantity = value_of(learned)
    return f"{quantity.name.replace('_', ' ')} ({quantity.unit or '–'})", quantity.unit or "–"


def _spread(trained: Trained) -> tuple[Drawing, ...]:
    """How the quantity is spread over the poses kept out, as a first idea of what the answers are like."""
    true = trained.held_out.value[: trained.uniform]
    values = value_of(trained.best).factor * (1.0 / true if trained.best.quantity.name == COMPLIANCE else true)
    values = values[np.isfinite(values) & (values > 0.0)]
    if not values.size:
        return ()
    caption = "Poses drawn evenly over the joint ranges; half of the answers lie between the dotted lines."
    return (Drawing("answers", caption, "answers", partial(spread_figure, values, _unit(trained.best)[0])),)


def _judged(trained: Trained) -> list[JudgedBars]:
    """Errors and bars of every surrogate on the uniform runs kept out."""
    held, n = trained.held_out, trained.uniform
    out = []
    for i, one in enumerate(trained.surrogates):
        assert one.bars is not None  # noqa: S101 - training has judged it
        error = np.abs(trained.predicted[one.basis][:n] / held.value[:n] - 1.0)
        out.append(JudgedBars(one.basis, error, one.bars.half_width(held.Q[:n]), i))
    return out


def _choice(trained: Trained) -> Section:
    n, edge = trained.uniform, len(trained.held_out.Q) - trained.uniform
    blocks: list[Block] = [
        Text(choice_words(trained)),
        *(Note(f"{text}.") for text in doubts(trained)),
        Text(
            f"RMS, “95 % below” and “worst, with limits” are over {n} uniform poses and {edge} poses on joint limits "
            "together; “worst, uniform” is over the uniform poses alone. “6 x 6 worst”: largest error of the whole "
            "compliance matrix, by its Frobenius norm. “Inside bars”: share of the uniform runs inside their 95 % "
            "error bars. “Condition”: condition number of the least-squares matrix."
        ),
        Bullets(tuple(f"{s.basis}: {basis_words(s)}" for s in trained.surrogates)),
    ]
    if trained.refused:
        blocks.append(Bullets(tuple(f"{name} was not fitted: {why}" for name, why in trained.refused.items())))
    return Section("Which basis, and why", tuple(blocks))


def quality(trained: Trained) -> Drawing:
    """What every surrogate predicts against what is true, and how large the errors are."""
    best, true, factor = trained.best, trained.held_out.value, value_of(trained.best).factor
    of_compliance = best.quantity.name == COMPLIANCE
    rows, remarks = [], []
    for basis, y in trained.predicted.items():
        valid = y > 0.0
        if not valid.all():
            remarks.append(f" {basis} gives no positive value at {np.count_nonzero(~valid)} runs, which are left out.")
        if valid.any():
            shown = (1.0 / true[valid], 1.0 / y[valid]) if of_compliance else (true[valid], y[valid])
            rows.append(HeldOut(basis, factor * shown[0], factor * shown[1], of_compliance))
    caption = (
        "Each cell counts runs; on the line the surrogate is exact. The last panel shows what share of the runs has a "
        "larger error than a given one: further left is better." + "".join(remarks)
    )
    draw = partial(surrogate_quality_figure, rows, _unit(best)[0], best.quantity.name)
    return Drawing("predicted_and_true", caption, "predicted and true", draw)


def _bars(trained: Trained, bars: Sequence[JudgedBars]) -> list[Drawing]:
    """Whether the error bars hold, and where the errors are large, of those that are worth a look."""
    caption = (
        "Left: error divided by the half-width of its bar; above 1 the true value lies outside the bar, which should "
        "happen in 5 % of the runs. Right: share inside, from narrow bars to wide ones. The bars were learned from "
        "other runs than these."
    )
    beyond = [row.name for row in bars if bool((row.error > MOST_SHOWN * row.half_width).any())]
    if beyond:
        caption += f" Ratios above {MOST_SHOWN:g} ({', '.join(beyond)}) are right of the axis."
    out = [Drawing("error_bars", caption, "error bars", partial(error_bars_figure, bars))]
    shown = [row for row in bars if not _tiny(row)]
    if shown:
        degrees = np.degrees(trained.held_out.Q[: trained.uniform])
        caption = (
            "Runs grouped by one coordinate, over all values of the others. Solid: 95 % of the runs are below; "
            f"dashed: median. {_small_words(bars)}"
        )
        draw = partial(error_over_inputs_figure, shown, trained.best.inputs, degrees)
        out.append(Drawing("error_over_inputs", caption, "error over inputs", draw))
    return out


def _honesty(chosen: JudgedBars) -> Section:
    tenths = parts(chosen)
    low, high = (pick(range(len(tenths)), key=lambda i: tenths[i].inside) for pick in (min, max))
    spread = chance(min(p.runs for p in tenths))
    honest = tenths[low].inside >= LEVEL - 2.0 * spread
    words = (
        f"Of {len(chosen.error)} uniform runs {share_words(chosen.inside)} lie inside the 95\u00a0% bars of the "
        f"{chosen.name} basis. When the runs are split into tenths from the narrowest bars (1) to the widest (10), the "
        f"share goes from {share_words(tenths[low].inside)} (tenth {low + 1}) to {share_words(tenths[high].inside)} "
        f"(tenth {high + 1}). "
        + (
            "Narrow and wide bars alike hold what they promise."
            if honest
            else f"In tenth {low + 1} the bars are too narrow, by more than chance."
        )
        + (" With errors below a millionth this does not matter." if _tiny(chosen) else "")
    )
    rows = tuple(
        (str(i + 1), str(p.runs), relative(p.half_width), relative(p.error), share_words(p.inside))
        for i, p in enumerate(tenths)
    )
    columns = ("tenth", "runs", "half-width, median", "error, median", "inside")
    blocks: tuple[Block, ...] = (
        Text(words),
        page.Table(f"Error bars of the {chosen.name} basis by their width", columns, rows, folded=True),
        Text(
            "The 95 % are for poses drawn evenly over the domain. For a special set of poses, such as poses that all "
            "lie on a limit, the share may differ."
        ),
    )
    return Section("Do the error bars hold", blocks)


def _tiny(row: JudgedBars) -> bool:
    return float(np.max(row.error)) <= NOTHING


def _small_words(bars: Sequence[JudgedBars]) -> str:
    small = [row.name for row in bars if _tiny(row)]
    return f"Errors of {' and '.join(small)} are below a millionth and not drawn." if small else ""


def _where(trained: Trained, bars: Sequence[JudgedBars]) -> Section:
    """Where the errors are largest, of the surrogates whose errors are worth a look."""
    shown, degrees = [row for row in bars if not _tiny(row)], np.degrees(trained.held_out.Q[: trained.uniform])
    words: Block = Bullets(tuple(_worst_words(trained.best, row, degrees) for row in shown))
    return Section("Where the error is large", (words if shown else Text(f"Nowhere. {_small_words(bars)}"),))


def _worst_words(best: Learned, row: JudgedBars, degrees: Array) -> str:
    i = int(np.argmax(row.error))
    pose = ", ".join(f"{n.removesuffix('_deg')} {v:.1f}" for n, v in zip(best.inputs, degrees[i], strict=True))
    error, bar = relative(float(row.error[i])), relative(float(row.half_width[i]))
    return f"{row.name}: the largest error of the uniform runs, {error}, is at {pose} deg; its bar there is {bar}."
