"""The milling file: cutter, cut and coefficients as a TOML, in the shop's units."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from machining.cell.schema import Positive, Strict
from machining.cutting.coefficients import CuttingCoefficients, PlungeCoefficients, published, shop_coefficients
from machining.cutting.end_mill import Bending, EndMill, Engagement, ToolBending, down_milling, slotting, up_milling
from machining.cutting.force import ASSUMED_SD, CuttingForce, MillingForce
from robots import InputError
from robots.files.reading import parse_toml, read_text
from robots.files.validated import validated

SCHEMA = "stiffarm-milling/1"
# A face mill has some fifty; a helix near 90 deg is no cutter but a ring.
MOST_TEETH, STEEPEST_DEG = 1000, 85.0


@dataclass(frozen=True, eq=False)
class Cut:
    """The cutting force, and the tool's own bending (None: not given, taken as rigid)."""

    force: CuttingForce
    tool: Bending | None = None


class _Mill(Strict):
    diameter_mm: Positive
    teeth: Annotated[int, Field(ge=1, le=MOST_TEETH)]
    helix_deg: Annotated[float, Field(ge=0.0, le=STEEPEST_DEG)] = 0.0


class _Cut(Strict):
    kind: Literal["down", "up", "slot"]
    axial_depth_mm: Positive
    radial_depth_mm: Positive | None = None
    feed_per_tooth_mm: Positive | None = None
    spindle_rpm: Positive | None = None
    instant: Literal["mean", "generating"] = "mean"


class _Material(Strict):
    published: str | None = None
    tc_N_per_mm2: float | None = None  # noqa: N815 - units are in the names of the file's keys
    te_N_per_mm: float | None = None  # noqa: N815
    rc_N_per_mm2: float | None = None  # noqa: N815
    re_N_per_mm: float | None = None  # noqa: N815
    ac_N_per_mm2: float = 0.0  # noqa: N815
    ae_N_per_mm: float = 0.0  # noqa: N815
    source: str | None = None
    relative_sd: Annotated[float, Field(ge=0.0)] = ASSUMED_SD


class _Bending(Strict):
    stickout_mm: Positive
    diameter_mm: Positive
    modulus_GPa: Positive = 600.0  # noqa: N815
    relative_sd: Annotated[float, Field(ge=0.0, le=0.5)] = 0.2


class _Plunge(Strict):
    chip_N_per_mm2: Positive  # noqa: N815
    edge_N_per_mm: Annotated[float, Field(ge=0.0)]  # noqa: N815
    source: str
    relative_sd: Annotated[float, Field(ge=0.0)] = ASSUMED_SD


class _File(Strict):
    milling_schema: Annotated[str, Field(alias="schema")]
    mill: _Mill
    cut: _Cut
    material: _Material
    tool: _Bending | None = None
    plunge: _Plunge | None = None


def read_milling(path: str | Path) -> Cut:
    """Read a milling file.

    Raises
    ------
    InputError
        The file cannot be read, another schema, or figures that make no cut.
    InputErrors
        Keys that are missing, unknown or of the wrong kind, all of them.
    """
    file = Path(path)
    table = parse_toml(read_text(file, "milling file"), str(file))
    if table.get("schema") != SCHEMA:
        raise InputError(
            f"milling file {file}: schema",
            code="F006",
            value=str(table.get("schema")),
            allowed=SCHEMA,
            remedy=f'write schema = "{SCHEMA}"',
        )
    read = validated(_File, table, f"milling file {file}", remedy="correct, add or remove it")
    mill = EndMill(read.mill.diameter_mm * 1e-3, read.mill.teeth, float(np.radians(read.mill.helix_deg)))
    return Cut(_force(read, mill), _bending(read.tool))


def _force(read: _File, mill: EndMill) -> MillingForce:
    cut = read.cut
    if (cut.feed_per_tooth_mm is None) == (cut.spindle_rpm is None):
        raise InputError(
            "milling file, [cut]: feed_per_tooth_mm and spindle_rpm",
            code="K005",
            value="both" if cut.spindle_rpm is not None else "neither",
            allowed="one of them",
            remedy="with spindle_rpm the feed per tooth comes from the path's feed",
        )
    return MillingForce(
        mill,
        _engagement(cut, mill),
        _coefficients(read.material),
        instant=cut.instant,
        feed_per_tooth=None if cut.feed_per_tooth_mm is None else cut.feed_per_tooth_mm * 1e-3,
        spindle_speed=None if cut.spindle_rpm is None else cut.spindle_rpm * 2.0 * np.pi / 60.0,
        relative_sd=read.material.relative_sd,
        plunge=_plunge(read.plunge),
    )


def _plunge(table: _Plunge | None) -> PlungeCoefficients | None:
    if table is None:
        return None
    return PlungeCoefficients(table.chip_N_per_mm2 * 1e6, table.edge_N_per_mm * 1e3, table.source, table.relative_sd)


def _engagement(cut: _Cut, mill: EndMill) -> Engagement:
    axial = cut.axial_depth_mm * 1e-3
    if cut.kind == "slot":
        if cut.radial_depth_mm is not None:
            raise InputError(
                "milling file, [cut]: radial_depth_mm of a slot",
                code="K005",
                value=cut.radial_depth_mm,
                remedy="leave it out",
            )
        return slotting(mill, axial)
    if cut.radial_depth_mm is None:
        raise InputError(
            "milling file, [cut]: radial_depth_mm is missing", code="K005", allowed="up to the mill's diameter"
        )
    return (up_milling if cut.kind == "up" else down_milling)(mill, axial, cut.radial_depth_mm * 1e-3)


def _coefficients(material: _Material) -> CuttingCoefficients:
    given = (material.tc_N_per_mm2, material.te_N_per_mm, material.rc_N_per_mm2, material.re_N_per_mm)
    if material.published is not None:
        if any(v is not None for v in given):
            raise InputError(
                "milling file, [material]", code="K005", value="published and figures", allowed="one of the two"
            )
        return published(material.published)
    tc, te, rc, re = given
    if tc is None or te is None or rc is None or re is None or material.source is None:
        raise InputError(
            "milling file, [material]",
            code="K005",
            allowed="published = NAME, or tc_N_per_mm2, te_N_per_mm, rc_N_per_mm2, re_N_per_mm and their source",
            remedy="complete it",
        )
    return shop_coefficients(tc, te, rc, re, material.ac_N_per_mm2, material.ae_N_per_mm, source=material.source)


def _bending(tool: _Bending | None) -> ToolBending | None:
    if tool is None:
        return None
    return ToolBending(tool.stickout_mm * 1e-3, tool.diameter_mm * 1e-3, tool.modulus_GPa * 1e9, tool.relative_sd)
