"""report.html of a fit: which basis was taken and why, how wrong it is and where, whether its error bars hold."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import numpy as np

from robots.arrays import Array
from robots.quantities import relative
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
from stiffarm.commands.fit.results import errors_table
from stiffarm.commands.fit.sections import Known, answer_section, known_by, usage_section
from stiffarm.commands.fit.words import (
    KNOWN,
    LARGE,
    basis_words,
    choice_words,
    doubts,
    half_width,
    share_words,
)
from stiffarm.commands.query.answers import value_name
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import (
    Answer,
    Block,
    Bullets,
    KeyFigure,
    Note,
    Picture,
    Section,
    Table,
    Text,
    write_page,
)
from stiffarm.session.outputs import OutputFolder
from surrogate import Surrogate, Trained
from surrogate.model import COMPLIANCE
from surrogate.training import NOTHING


def write_report(trained: Trained, files: Sequence[str], folder: OutputFolder, *, title: str, model: str) -> None:
    """Draw the figures and write report.html.

    Parameters
    ----------
    files : that a reader opens; they and the surrogates' ``surrogate_<basis>.json`` are in the folder already
    title, model : of the robot, and as the command was given it
    """
    pictures = Pictures(folder)
    bars = _judged(trained)
    known = known_by(trained)
    best = trained.best
    sections = [
        usage_section(trained, files, model, folder),
        _choice(trained),
        Section("Predicted against true", (quality_picture(trained, pictures),), folded=True),
        _honesty(trained, bars, pictures),
        _where(trained, bars, pictures),
        answer_section(trained, known),
    ]
    answer = Answer(_sure(trained, known), _todo(trained, known, model), _spread_picture(trained, pictures))
    write_page(folder, title, _lede(best, known), _key_figures(best, known), sections, QUESTION, "", answer)


QUESTION = "which surrogate, and how far to trust it?"


def _lede(best: Surrogate, known: Known | None) -> str:
    what = f"the {best.quantity.label} at any pose of {len(best.inputs)} joint coordinates"
    own = f"its own error is {relative(best.errors.rms_relative)} (RMS)"
    if known is None:
        return f"It gives {what}: {own}. The uncertainty of the model itself is not known."
    limits = "the calibration, not the surrogate," if known.median > best.errors.rms_relative else "the surrogate"
    return f"It gives {what}: {own}, and {limits} limits the accuracy of an answer."


def _key_figures(best: Surrogate, known: Known | None) -> list[KeyFigure]:
    key = [
        KeyFigure(relative(best.errors.rms_relative), "own error (RMS, runs it has not seen)"),
        KeyFigure(relative(best.errors.max_relative), "own error, worst of these runs"),
        KeyFigure(share_words(best.errors.coverage95), "of these runs inside the 95 % error bars"),
    ]
    if known is not None:
        shown = f"± {relative(known.median)}" if known.median < KNOWN else "not known"
        key.insert(0, KeyFigure(shown, "95 % interval of an answer by the calibration, median pose"))
    return key


def _sure(trained: Trained, known: Known | None) -> str:
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


def _todo(trained: Trained, known: Known | None, model: str) -> str:
    best, named = trained.best, shlex.quote(model)
    if best.errors.rms_relative > LARGE:
        return f"Try more runs or another basis: `stiffarm fit {named} --runs {4 * best.errors.n_train} --out more`."
    if known is None:
        return f"Calibrate the model first: `stiffarm calibrate {named} DATA --out calibrated`."
    if known.median >= KNOWN or any(known.open_share.values()):
        return f"More readings would narrow the intervals: `stiffarm plan {named} --poses 6` chooses them."
    return "Use it: `stiffarm query surrogate.json --pose ...`; the commands are below."


def _spread_picture(trained: Trained, pictures: Pictures) -> Picture | None:
    """How the quantity is spread over the poses kept out, as a first idea of what the answers are like."""
    name, factor = value_name(trained.best)
    true = trained.held_out.value[: trained.uniform]
    values = factor * (1.0 / true if trained.best.quantity.name == COMPLIANCE else true)
    values = values[np.isfinite(values) & (values > 0.0)]
    if not values.size:
        return None
    unit = "N/mm" if name.endswith("_N_per_mm") else "–"
    what = f"{name.removesuffix('_N_per_mm').replace('_', ' ')} ({unit})"
    caption = "Poses drawn evenly over the joint ranges; half of the answers lie between the dotted lines."
    return pictures.add(spread_figure(values, what), "answers", caption)


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
        errors_table(trained),
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


def quality_picture(trained: Trained, pictures: Pictures) -> Picture:
    """What every surrogate predicts against what is true, and how large the errors are."""
    best, true = trained.best, trained.held_out.value
    name, factor = value_name(best)
    of_compliance = best.quantity.name == COMPLIANCE
    unit = "N/mm" if name.endswith("_N_per_mm") else "–"
    rows, remarks = [], []
    for basis, y in trained.predicted.items():
        valid = y > 0.0
        if not valid.all():
            remarks.append(f" {basis} gives no positive value at {np.count_nonzero(~valid)} runs, which are left out.")
        if valid.any():
            shown = (1.0 / true[valid], 1.0 / y[valid]) if of_compliance else (true[valid], y[valid])
            rows.append(HeldOut(basis, factor * shown[0], factor * shown[1], of_compliance))
    what = f"{name.removesuffix('_N_per_mm')} ({unit})"
    caption = (
        "Each cell counts runs; on the line the surrogate is exact. The last panel shows what share of the runs has a "
        "larger error than a given one: further left is better." + "".join(remarks)
    )
    figure = surrogate_quality_figure(rows, what, best.quantity.name)
    return pictures.add(figure, "predicted_and_true", caption)


def _honesty(trained: Trained, bars: list[JudgedBars], pictures: Pictures) -> Section:
    chosen = bars[0]
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
    caption = (
        "Left: error divided by the half-width of its bar; above 1 the true value lies outside the bar, which should "
        "happen in 5 % of the runs. Right: share inside, from narrow bars to wide ones. The bars were learned from "
        "other runs than these."
    )
    beyond = [row.name for row in bars if bool((row.error > MOST_SHOWN * row.half_width).any())]
    if beyond:
        caption += f" Ratios above {MOST_SHOWN:g} ({', '.join(beyond)}) are right of the axis."
    blocks: tuple[Block, ...] = (
        Text(words),
        pictures.add(error_bars_figure(bars), "error_bars", caption),
        Table(f"Error bars of the {chosen.name} basis by their width", columns, rows, folded=True),
        Text(
            "The 95 % are for poses drawn evenly over the domain. For a special set of poses, such as poses that all "
            "lie on a limit, the share may differ."
        ),
    )
    return Section("Do the error bars hold", blocks)


def _tiny(row: JudgedBars) -> bool:
    return float(np.max(row.error)) <= NOTHING


def _where(trained: Trained, bars: list[JudgedBars], pictures: Pictures) -> Section:
    """Errors over the inputs, of the surrogates whose errors are worth a look."""
    best, n = trained.best, trained.uniform
    shown = [row for row in bars if not _tiny(row)]
    small = [row.name for row in bars if row not in shown]
    small_words = f"Errors of {' and '.join(small)} are below a millionth and not drawn." if small else ""
    if not shown:
        return Section("Where the error is large", (Text(f"Nowhere. {small_words}"),))
    degrees = np.degrees(trained.held_out.Q[:n])
    caption = (
        "Runs grouped by one coordinate, over all values of the others. Solid: 95 % of the runs are below; dashed: "
        f"median. {small_words}"
    )
    figure = error_over_inputs_figure(shown, best.inputs, degrees)
    blocks: list[Block] = [Bullets(tuple(_worst_words(best, row, degrees) for row in shown))]
    return Section("Where the error is large", (*blocks, pictures.add(figure, "error_over_inputs", caption)))


def _worst_words(best: Surrogate, row: JudgedBars, degrees: Array) -> str:
    i = int(np.argmax(row.error))
    pose = ", ".join(f"{n.removesuffix('_deg')} {v:.1f}" for n, v in zip(best.inputs, degrees[i], strict=True))
    error, bar = relative(float(row.error[i])), relative(float(row.half_width[i]))
    return f"{row.name}: the largest error of the uniform runs, {error}, is at {pose} deg; its bar there is {bar}."
