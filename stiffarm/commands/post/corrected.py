"""A program that is corrected for a calibrated arm: its figures, words and part of the page."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from doe.absolute.readings import Payload
from machining.programs.calibrated_arm import Corrected
from machining.programs.run import PostRun
from robots import InputError, ModelDescription
from robots.schema.joint_errors import Positions
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.figure_parts import LINES, SERIES, drawing
from stiffarm.pages.report import Bullets, Picture, Section, Table, Text
from stiffarm.session.json_text import number
from stiffarm.session.parsing import parse_payload

CONTROLLER: Final = (
    "Joint and Cartesian targets are both moved, for a controller that computes with the arm as designed. Where its "
    "maker's own calibration is switched on (absolute accuracy), or joint zeros or lengths were corrected in it, the "
    "correction would count twice: calibrate and run with the same settings. Ratios, couplings and curves of joints "
    "are in the targets alone; between targets the controller goes straight, or joint by joint, as it always does."
)
PARTS: Final = ("geometry", "weight", "force")


def payload_of(description: ModelDescription, text: str | None, *, compensate: bool) -> Payload | None:
    """What the flange carries, where geometry is compensated; None where it is not.

    Raises
    ------
    InputError
        ``--payload`` without a use for it, or one that is no mass with a place.
    """
    corrects = compensate and description.positions is not None
    if text is None:
        return Payload(0.0, np.zeros(3)) if corrects else None
    if not corrects:
        raise InputError(
            "--payload",
            code="A002",
            value=text,
            allowed="with --compensate, and a model that positions have calibrated",
            remedy="leave it out, or run `stiffarm calibrate` on a table of positions and take its model.toml",
        )
    return parse_payload(text)


def not_corrected(description: ModelDescription, *, compensate: bool) -> tuple[str, ...]:
    """A note where the arm's errors are known and not in the program."""
    if description.positions is None or compensate:
        return ()
    return ("the model has errors of the arm's geometry, which are not in this program: --compensate takes them in",)


def payload(found: Corrected, positions: Positions) -> dict[str, Any]:
    """Figures, keys with units."""
    sizes = {name: np.linalg.norm(getattr(found, name), axis=1) * 1e6 for name in PARTS}
    return {
        "largest_um": number(float(found.moved.max(initial=0.0)) * 1e6),
        "mean_um": number(float(found.moved.mean()) * 1e6),
        "by": {
            name: {"largest_um": number(float(v.max(initial=0.0))), "mean_um": number(float(v.mean()))}
            for name, v in sizes.items()
        },
        "place_sd_um": number(found.place_sd * 1e6),
        "turns_corrected": found.turns,
        "turn_sd_urad": number(found.turn_sd * 1e6),
        "largest_turn_urad": number(float(found.turned.max(initial=0.0)) * 1e6),
        "left_um": number(float(found.left.max(initial=0.0)) * 1e6),
        "between_points_um": {name: number(v * 1e6) for name, v in found.between.items()},
        "targets_where_a_joint_error_is_not_identified": dict(found.unread),
        "error_sd_um": None if found.error is None else number(float(found.error.sd.max()) * 1e6),
        "calibrated_rms_mm": {"readings_left_out": positions.left_out_rms_mm, "before": positions.before_rms_mm},
        "rounds": found.rounds,
        "controller": CONTROLLER,
    }


def words(found: Corrected, positions: Positions) -> str:
    """The correction in a sentence or two."""
    c = payload(found, positions)
    parts = ", ".join(f"{name} up to {c['by'][name]['largest_um']:.3g} um" for name in PARTS)
    return (
        f"Targets are moved so that the calibrated arm reaches the path: up to {c['largest_um']:.0f} um, in the mean "
        f"{c['mean_um']:.0f} um ({parts}). By the model {max(c['left_um'], 0.001):.1g} um is left at the targets, and "
        f"half-way between them up to {c['between_points_um']['cartesian']:.2g} um (joint program: "
        f"{c['between_points_um']['joint']:.2g} um). How right the model is: readings that its calibration had not "
        f"seen are predicted to {positions.left_out_rms_mm:.3g} mm RMS (as described: {positions.before_rms_mm:.3g})."
        + (
            ""
            if np.isnan(found.place_sd)
            else f" In the arm's base frame it knows this tool point to {c['place_sd_um']:.0f} um (standard deviation)."
        )
    )


def remarks(run: PostRun, found: Corrected) -> tuple[str, ...]:
    """What must be known before the program runs."""
    out = [CONTROLLER]
    if found.unread:
        where = ", ".join(f"{joint} at {count}" for joint, count in found.unread.items())
        out.append(
            f"of {run.posted.program.n} targets, error curves of joints are not identified for {where}: there the "
            "correction lacks them; another gamma or branch may stand where the arm was read"
        )
    if not found.turns:
        out.append(
            f"the tool's axes are not corrected: the readings tell them to {2e3 * found.turn_sd:.2g} mrad only (95 %), "
            f"for errors of up to {1e3 * found.turned.max(initial=0.0):.2g} mrad; several targets, far apart, tell them"
        )
    out.append("part and tool frames must be measured on the same arm: an error of theirs moves the whole path")
    if run.request.payload is not None and run.request.payload.kg == 0.0:
        out.append("the flange carries nothing by this: give spindle and tool with --payload KG,X,Y,Z")
    return tuple(out)


def section(run: PostRun, found: Corrected, positions: Positions, pictures: Pictures) -> Section:
    """The page's part."""
    x = np.arange(len(found.moved), dtype=np.float64)
    lines = {"all": found.moved} | {name: np.linalg.norm(getattr(found, name), axis=1) for name in PARTS}
    with drawing("How far the tool would be off the path", (10.0, 3.3)) as (figure, (ax,)):
        for k, (name, values) in enumerate(lines.items()):
            ax.plot(x, values * 1e6, color=SERIES[k % len(SERIES)], linestyle=LINES[k % len(LINES)], label=name)
        ax.set(xlabel="move", ylabel="off, um")
        ax.set_ylim(0.0, 1.25e6 * max(float(values.max(initial=1e-6)) for values in lines.values()))
        ax.legend(loc="upper right", ncols=4)
    picture: Picture = pictures.add(
        figure, "correction", "By the calibrated model, at the targets as designed; compensation takes it off."
    )
    c = payload(found, positions)
    rows = tuple((name, f"{c['by'][name]['largest_um']:.4g}", f"{c['by'][name]['mean_um']:.4g}") for name in PARTS)
    table = Table("What the correction is made of", ("part", "largest, um", "mean, um"), rows, text_columns=(0,))
    return Section(
        "Correction for the calibrated arm",
        (Text(words(found, positions)), picture, table, Bullets(remarks(run, found))),
    )
