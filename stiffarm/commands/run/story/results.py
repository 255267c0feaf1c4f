"""The report's second half: main effects, surrogate, maps, assumptions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from robots.quantities import significant
from robots.schema.quantities import Quantity
from stiffarm.commands.fit.figures.effects import main_effects_figure
from stiffarm.commands.fit.report import errors_table, quality
from stiffarm.commands.run.findings import Findings, slug
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Bullets, Fold, Note, Picture, Section, Table, Text
from surrogate import default_sweep
from surrogate.main_effects import main_effects
from surrogate.maps.quantities import STIFFNESS_ARRAY


def effects_section(f: Findings, pictures: Pictures) -> Section:
    """Main effects over the factorial."""
    first = next(iter(f.factorial.values()))
    count, plan = len(first.poses_deg), first.plan
    whole = int(np.prod([len(levels) for levels in plan.levels_deg]))
    text = f"{count} runs of the full factorial of {', '.join(plan.inputs)}."
    if count < whole:
        text = f"{count} of the {whole} runs of the full factorial of {', '.join(plan.inputs)} can be reached."
    if plan.adjust:
        text += (
            " Some levels are adjusted because the robot cannot reach every combination, so the design is not "
            "orthogonal and the main effects are slightly confounded."
        )
    blocks: list[Block] = [Text(text)]
    # One picture: that of the model to take.
    for name, runs in ((name, runs) for name, runs in f.factorial.items() if name == f.best.name):
        effects = main_effects(runs.poses_deg, runs.stiffness_N_per_mm, runs.inputs)
        caption = (
            f"{name.capitalize()} (recommended model): largest, mean and smallest normalised stiffness at each level "
            f"(1 = {runs.stiffness_N_per_mm.max():.0f} N/mm)."
        )
        if f.best.depends_on_angles:
            caption += (
                " Angle-dependent springs are interpolated between few poses; extremes far from those poses are "
                "extrapolated, not measured."
            )
        blocks.append(pictures.add(main_effects_figure(effects), f"main_effects_{slug(name)}", caption))
    return Section("Main effects of the joint angles", tuple(blocks), folded=True)


def surrogate_section(f: Findings, pictures: Pictures) -> Section:
    """Held-out errors of every basis, and the measured poses."""
    drawn = quality(f.trained[f.best.name])
    errors = [errors_table(one, name.capitalize()) for name, one in f.trained.items()]
    return Section(
        "The surrogate and its error",
        (
            Text(
                "A surrogate gives the structural stiffness under a vertical load from "
                f"{', '.join(f.factorial[f.best.name].inputs)} without the FE model. Errors are relative errors of "
                "compliance on runs that neither the fit nor its error bars have seen. Some of these runs lie on the "
                "boundary of the domain, where polynomials are worst; “worst, uniform” leaves those out. "
                "surrogate.json is the first basis of the recommended model."
            ),
            *(replace(one.block(), caption=one.caption) for one in errors),
            pictures.add(drawn.draw(), drawn.name, drawn.caption),
            _measured_poses(f),
            Note(
                "Outside the fitted joint ranges, or where the robot cannot go, the surrogate flags the pose and "
                "gives no value unless you ask for one (`--extrapolate`)."
            ),
        ),
        folded=True,
    )


def _measured_poses(f: Findings) -> Table:
    worst = f.surrogate.errors.max_relative
    rows = tuple(
        (
            pose,
            f"{learned:.2f}",
            f"{exact:.2f}",
            f"{learned / exact - 1.0:+.1e}",
            "yes" if abs(exact / learned - 1.0) <= max(worst, 1e-12) else "NO",
        )
        for pose, learned, exact in zip(*f.pose_check, strict=True)
    )
    columns = (
        "pose",
        "surrogate (N/mm)",
        "model (N/mm)",
        "relative difference",
        "within the largest error above",
    )
    return Table("The measured poses", columns, rows)


def map_section(f: Findings, drawn: Mapping[str, Any], views: Sequence[Picture]) -> Section:
    """The stiffness map from both viewpoints."""
    k = drawn["quantities"][STIFFNESS_ARRAY]
    swept, layer = default_sweep(f.given.robot)
    text = f"{drawn['points']} poses swept over {', '.join(swept)}"
    text += f", with {layer} moving the tool out of the plane. " if layer else ". "
    low, high = significant(k["min"]), significant(k.get("max_near_singular", k["max"]))
    text += (
        f"Stiffness under a vertical load runs from {low} to {high} N/mm; it is largest where the load passes through "
        "the joints. map.html is the map: turn it, cut it, pick points."
    )
    file = "stiffness_map.vtu opens in ParaView; docs/reference/stiffness_map.md lists its arrays and their units."
    shown = [view for view in views if view.path.stem.endswith("_side")]
    rest: list[Block] = [*(view for view in views if view not in shown), Text(file)]
    return Section("The stiffness map", (Text(text), *shown, Fold("From another side, and as a file", tuple(rest))))


def assumptions_section(f: Findings) -> Section:
    """Every figure of the model with its source."""
    # A source whose text begins so is an assumption too, with its reason.
    guesses = {key for key, text in f.given.description.sources.items() if text.startswith("assumed")}
    rows = tuple(
        (place, value, "assumed" if source in guesses else source, note)
        for place, value, source, note in quantities(f.given.description, "")
    )
    assumed = sum(row[2] == "assumed" for row in rows)
    sources = tuple(f"{key}: {text}" for key, text in f.given.description.sources.items())
    return Section(
        "Assumptions and sources",
        (
            Note(
                f"{assumed} of {len(rows)} figures of the robot's description are assumed. Calibrated springs "
                "absorb part of the errors in them; absolute link shares do not."
            ),
            Bullets(f.given.description.notes),
            Bullets(sources),
            Table(
                "Every figure of the model with its source",
                ("figure", "value", "source", "note"),
                rows,
                text_columns=(0, 1, 2, 3),
            ),
        ),
        folded=True,
    )


def quantities(node: Any, place: str) -> list[tuple[str, str, str, str]]:
    """All figures of a description: place in the file, value with unit, source, note."""
    if isinstance(node, Quantity):
        value = ", ".join(f"{v:g}" for v in node.value) if isinstance(node.value, tuple) else f"{node.value:g}"
        return [(place, f"{value} {node.unit}", node.source, node.note or "")]
    out: list[tuple[str, str, str, str]] = []
    if isinstance(node, tuple):
        for i, child in enumerate(node):
            out += quantities(child, f"{place}[{getattr(child, 'name', i)}]")
    elif hasattr(type(node), "model_fields"):
        for name in type(node).model_fields:
            out += quantities(getattr(node, name), f"{place}.{name}" if place else name)
    elif isinstance(node, dict):
        for name, child in node.items():
            out += quantities(child, f"{place}.{name}")
    return out
