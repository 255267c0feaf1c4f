"""The report's section on what the paper says about its map, checked on the models of this run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from stiffarm.commands.run.figures.findings import findings_figure
from stiffarm.commands.run.findings import Finding, model_findings, payload
from stiffarm.commands.run.samples import Samples
from stiffarm.commands.run.workflow import Findings
from stiffarm.pages.blocks import Pictures, short_title
from stiffarm.pages.report import Block, Bullets, Note, Section, Table, Text


class Checked(NamedTuple):
    """The findings on one variant's model, and the samples that they rest on, if it could be sampled."""

    samples: Samples | None
    findings: list[Finding]


def check(f: Findings) -> dict[str, Checked]:
    """Check the paper's findings on the recommended variant and on that of the published scheme, by name."""
    variants = {v.name: v for v in (f.best, f.published)}
    return {name: Checked(*model_findings(v.model, seed=f.seed)) for name, v in variants.items()}


def json_of(checked: Mapping[str, Checked]) -> dict[str, Any]:
    """All findings for results.json, by the variant's name."""
    return {name: payload(one.findings) for name, one in checked.items()}


def findings_section(f: Findings, checked: Mapping[str, Checked], pictures: Pictures) -> Section:
    """Verdicts side by side, the figures behind them, and what the verdicts were held against."""
    best = checked[f.best.name]
    names = [f"{name} ({_role(f, name)})" for name in checked]
    rows = tuple(
        (claim.claim, *(one.findings[k].verdict for one in checked.values())) for k, claim in enumerate(best.findings)
    )
    blocks: list[Block] = [
        Text(
            "The paper on the ACMA XR701 reads three things off its map (section 3): low stiffness far from the main Z "
            "axis and at large stretch, soft and stiff regions close together in the middle of the workspace, and q4 "
            "almost without influence. Here they are asked of poses spread evenly over the joint ranges."
        ),
        Table("Whether they hold on our models", ("claim", *names), rows, text_columns=tuple(range(len(names) + 1))),
    ]
    for name, one in checked.items():
        blocks.append(Text(f"{name[:1].upper()}{name[1:]}:"))
        blocks.append(Bullets(tuple(finding.sentence for finding in one.findings)))
    differ = [
        k for k, finding in enumerate(best.findings) if len({c.findings[k].verdict for c in checked.values()}) > 1
    ]
    if differ:
        claims = "; ".join(best.findings[k].claim for k in differ)
        blocks.append(
            Note(
                f"The models do not agree on: {claims}. They have the same geometry and the same readings; "
                "what differs is how springs depend on the joint angles, between and beyond the measured poses."
            )
        )
    if best.samples is not None:
        blocks.append(
            pictures.add(
                findings_figure(best.samples, f"{short_title(f)}: what its stiffness depends on"),
                "findings",
                f"The recommended model ({f.best.name}): stiffness against the distance from the main axis and against "
                "stretch; where it ranges widely within a neighbourhood; how much of its variance each coordinate "
                "explains.",
            )
        )
    limits = tuple((finding.claim, finding.thresholds) for finding in best.findings if finding.thresholds)
    if limits:
        blocks.append(Table("What the verdicts mean", ("claim", "limits"), limits, text_columns=(0, 1), folded=True))
    return Section("The paper's findings on our map", tuple(blocks))


def _role(f: Findings, name: str) -> str:
    if name == f.best.name:
        return "recommended"
    return "the published scheme"
