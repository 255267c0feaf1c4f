"""What an import found: the model with its shells and solids, tables of its links, pictures of them."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from matplotlib.figure import Figure

import fem.arm
from meshes import link_beam_mesh, link_shell_mesh, save_shell
from meshes.surfaces.link import quality_words
from robots import ModelDescription, Remark, save_description
from robots.arrays import Array
from robots.library.surface_files import surface_file_name
from robots.quantities import Quantity, length, rounded
from robots.robot import robot_from
from robots.schema.description import Link, Surface
from robots.schema.quantities import Position, PositiveLength
from stiffarm.arm import as_face
from stiffarm.commands.importing.gate import TipCompliance, tip_compliances
from stiffarm.commands.importing.solids import MadeSolid, with_solids
from stiffarm.commands.importing.step import ImportedPart, MadeShell, RobotImport
from stiffarm.pages.report import Bullets, Fold, KeyFigure, Section, Text
from stiffarm.result import Drawing, Result, Table
from stiffarm.session.outputs import OutputFolder

SOURCE: Final = "meshes"
MODEL: Final = "model.toml"
VERDICTS: Final = {"trusted": "trusted", "warned": "with a warning", "refused": "no: plain section"}
WALL, SIZE, OFF = length("wall"), length("size"), length("departure", "off by")
CASING, DECLARED = Quantity("casing_mass", "kg", label="casing"), Quantity("urdf_mass", "kg", label="URDF")
ANGLE = Quantity("minimum_angle", "deg", label="least angle", digits=2)
TRIANGLES = Quantity("triangles", digits=0)
SHELL_TIP, BEAM_TIP = (
    Quantity(f"tip_compliance_{kind}", "um/kN", 1e9, f"tip as a {kind}") for kind in ("shell", "beam")
)
RATIO = Quantity("tip_compliance_shell_over_beam", label="shell / beam", digits=3)
TETRAHEDRA, MASS = Quantity("tetrahedra", digits=0), Quantity("mass", "kg", label="mass by volume")
# Folders of meshes that models in memory refer to; they go when the program ends.
_KEPT: list[tempfile.TemporaryDirectory[str]] = []


def of_robot(made: RobotImport) -> Result:
    """What an imported robot is."""
    folder = _place()
    names = tuple(part.name for part in made.parts)
    description = with_solids(as_description(made, folder), made.solids, folder, SOURCE)
    tips = tip_compliances(description, names)
    warnings = {part.name: warnings_of(part, tips[part.name]) for part in made.parts}
    said = [
        Remark(f"link {name}: {line}", code=getattr(line, "code", ""))
        for name, some in warnings.items()
        for line in some
    ]
    description = description.model_copy(update={"notes": (*description.notes, *said)})
    facts = {"robot": description.name, "material": made.material, "rigid": made.rigid}
    title = f"Imported links: {description.title}"
    return _result(description, made.parts, made.solids, (tips, warnings), facts, title)


def of_link(done: MadeShell | MadeSolid, given: ModelDescription, source: str) -> Result:
    """What a model with the new shell or solid of one link is."""
    folder, is_solid = _place(), isinstance(done, MadeSolid)
    key = f"{'solid' if is_solid else 'surface'} of {done.name}"
    data = given.model_dump(by_alias=True, exclude_none=True)
    data["sources"][key] = f"{source}, prepared by stiffarm import"
    facts = {"robot": given.name, "file": source}
    title = f"{source} as link {done.name}"
    if isinstance(done, MadeSolid):
        description = with_solids(ModelDescription.model_validate(data), [done], folder, key)
        return _result(description, (), (done,), ({}, {}), facts, title)
    surface = written_surface(done, folder, key)
    data["link"] = [
        link.model_copy(update={"surface": surface}) if link.name == done.name else link for link in given.link
    ]
    description = ModelDescription.model_validate(data)
    check_shells(description)
    tips = tip_compliances(description, (done.name,))
    return _result(description, (done,), (), (tips, {done.name: warnings_of(done, tips[done.name])}), facts, title)


def _place() -> Path:
    """A folder for the meshes of a model that is not saved yet."""
    _KEPT.append(tempfile.TemporaryDirectory(prefix="stiffarm-import-"))
    return Path(_KEPT[-1].name)


def _result(
    description: ModelDescription,
    shells: Sequence[MadeShell],
    solids: Sequence[MadeSolid],
    judged: tuple[Mapping[str, TipCompliance], Mapping[str, Sequence[str]]],
    facts: Mapping[str, Any],
    title: str,
) -> Result:
    tips, warnings = judged
    rigid: Mapping[str, str] = facts.get("rigid", {})
    kind: Literal["shell", "solid"] = "solid" if solids else "shell"
    arm = as_face(fem.arm.Arm.of(description, kind))
    warned = [
        Remark(f"{name}: {line.removeprefix('WARNING: ')}", code=getattr(line, "code", ""))
        for name, some in warnings.items()
        for line in some
    ]
    made = [
        f"{n} link{'s' * (n > 1)} became {'a ' * (n == 1)}{what}{'s' * (n > 1)}"
        for what, n in (("shell", len(shells)), ("solid", len(solids)))
        if n
    ]
    checks = f"{len(warned)} warning{'s' * (len(warned) > 1)} to check" if warned else "no warnings"
    worst = max((s.link.figures.departure_m[0] for s in shells if s.link.figures.departure_m[0] > 0.0), default=0.0)
    soft = {name: tip.shell for name, tip in tips.items()}
    key = [
        KeyFigure(str(len(shells) or len(solids)), "links as shells" if shells else "links as solids"),
        KeyFigure(str(len(warned)), "warnings"),
        KeyFigure(OFF.text(worst, unit=True), "deviation of shell from surface, 95\u00a0% below, worst link"),
    ]
    sheet = partial(_sheet, shells, solids, warnings, title)
    drawings = [Drawing("import", "The links and the rings at which they are held.", "imported links", sheet)]
    if soft:
        first = max(soft, key=soft.__getitem__)
        key.append(KeyFigure(SHELL_TIP.text(soft[first], unit=True), f"softest link at its tip: {first}"))
        caption = "Largest displacement of a link's tip under a unit force, with its root held."
        drawings.append(Drawing("tip_compliance", caption, "compliance of the links", partial(_bars, soft)))
    changes = {one.name: one.link.report for one in shells} | {one.name: one.solid.report for one in solids}
    return Result(
        name="import",
        title=description.title.split(" (")[0],
        question="what was made of the files?",
        answer=" and ".join(made) + (f", {len(rigid)} stay rigid" if rigid else "") + f"; {checks}.",
        how_sure=_how_sure(shells),
        what_next=f"{'Check the warnings, then calibrate' if warned else 'Calibrate'} with readings: `stiffarm "
        f"calibrate FOLDER/{MODEL} DATA`. `stiffarm plan FOLDER/{MODEL} --poses 6` chooses which readings to take.",
        facts=facts,
        tables=tuple(
            table for table in (_links(shells, tips, warnings), _walls(shells), _solids(solids, arm)) if len(table)
        ),
        drawings=tuple(drawings),
        key=tuple(key),
        sections=(
            Section(
                "What stays rigid", (Bullets(tuple(f"{name}: {why}" for name, why in rigid.items())),) if rigid else ()
            ),
            Section("How to read the table", (Text(COLUMNS),) if shells else (), folded=True),
            Section(
                "Repairs and changes",
                tuple(Fold(name, (Bullets(tuple(lines)),)) for name, lines in changes.items() if lines),
                folded=True,
            ),
        ),
        warnings=tuple(warned),
        remarks=tuple(line for line in description.notes if ": WARNING: " not in line) if "rigid" in facts else (),
        arm=arm,
        found=description,
        more=partial(_write, description),
    )


COLUMNS: Final = (
    "Off by: 95 % of the visible original surface is closer than this to the shell's outer side. As a shell: whether "
    "its stiffness as a shell can be trusted, judged by where its strain energy is. Shell / beam: tip compliance as a "
    "shell divided by that of a beam of its sections; where it is far from 1, check rings and wall. Bosses around "
    "joints across a link have 2.5 times the wall, on convex hulls the wall itself, unless `--boss` says otherwise. Of "
    "a link's mass 60 % counts as casing (80 % for a bare tube turning about its own length), the rest as drives, "
    "gears and cables. With `--links solid` links that have a solid are solids and the others shells."
)


def _write(description: ModelDescription, folder: OutputFolder) -> Mapping[str, Any]:
    save_description(description, folder.path(MODEL))
    return {}


def _bars(soft: Mapping[str, float]) -> Figure:
    from stiffarm.pages.bars import ranked_figure

    shown = {name: SHELL_TIP.factor * value for name, value in soft.items()}
    return ranked_figure("Compliance of the links", shown, "compliance of the tip (um/kN)", 12)


def _sheet(
    shells: Sequence[MadeShell], solids: Sequence[MadeSolid], warnings: Mapping[str, Sequence[str]], title: str
) -> Figure:
    from stiffarm.commands.importing.figures import contact_sheet

    facts = []
    for one in shells:
        figures, count = one.link.figures, len(warnings[one.name])
        how = "wrapped" if figures.wrapped else "as it is"
        facts.append(
            [f"{TRIANGLES.text(figures.triangles)} triangles, wall {WALL.text(one.wall, unit=True)}, surface {how}"]
        )
        facts[-1].append(f"rings: {_rings(figures.rings)}")
        facts[-1] += [f"{count} WARNING{'S' if count > 1 else ''}: see import.json"] if count else []
    facts += [
        [
            f"{len(one.solid.mesh.tetrahedra):,} tetrahedra, {MASS.text(one.kg, unit=True)}",
            f"seats: {_rings(one.solid.rings)}",
        ]
        for one in solids
    ]
    return contact_sheet([*(one.piece for one in shells), *(one.piece for one in solids)], facts, title)


def _rings(rings: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {length('radius').text(ring.radius)} mm" for name, ring in rings.items())


def _rings_json(rings: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: {"nodes": int(ring.nodes.size), "radius_mm": rounded(1e3 * ring.radius), "chosen": ring.words}
        for name, ring in rings.items()
    }


def _links(
    shells: Sequence[MadeShell], tips: Mapping[str, TipCompliance], warnings: Mapping[str, Sequence[str]]
) -> Table:
    figures = [one.link.figures for one in shells]
    found = [tips[one.name] for one in shells]

    def numbers(values: Sequence[float | None]) -> Array:
        return np.array([np.nan if v is None else v for v in values], dtype=float)

    values: dict[Quantity, Sequence[float | None]] = {
        WALL: [one.wall for one in shells],
        OFF: [one.departure_m[0] for one in figures],
        TRIANGLES: [one.triangles for one in figures],
        ANGLE: [one.minimum_angle_deg for one in figures],
        SHELL_TIP: [one.shell for one in found],
        RATIO: [one.ratio for one in found],
    }
    trust = [one.verdict.trust for one in shells]
    more: dict[Quantity, Sequence[float | None]] = {
        SIZE: [one.size_m for one in figures],
        BEAM_TIP: [one.beam for one in found],
        Quantity("half_energy_share"): [one.half_energy_share for one in trust],
        Quantity("wall_exponent"): [one.wall_exponent for one in trust],
        Quantity("mid_surface_area", "m2"): [one.area_m2 for one in figures],
        length("largest_departure"): [one.departure_m[1] for one in figures],
    }
    labels = {"link": [one.name for one in shells], "as_a_shell": [VERDICTS[one.verdict.kind] for one in shells]}
    labels["mesh"] = [quality_words(one.minimum_angle_deg) for one in figures]
    extra: dict[str, Sequence[Any]] = {
        "wall_basis": [one.basis.basis for one in shells],
        "wall_words": [one.basis.words for one in shells],
        "verdict": [one.verdict.kind for one in shells],
        **{name: [getattr(one, name) for one in figures] for name in ("bodies", "open_edges", "wrapped")},
        "rings": [_rings_json(one.rings) for one in figures],
        "warnings": [list(warnings[one.name]) for one in shells],
        "changes": [list(one.link.report) for one in shells],
    }
    parts = [one for one in shells if isinstance(one, ImportedPart)]
    if parts:
        values |= {
            CASING: [p.casing_kg for p in parts],
            DECLARED: [p.declared.si if p.declared else None for p in parts],
        }
        more |= {length("span"): [p.span for p in parts], Quantity("cover"): [p.section.cover for p in parts]}
        extra |= {
            "body": [p.body for p in parts],
            "files": [list(p.sources) for p in parts],
            "meshes": [p.kind for p in parts],
            "meshes_turned_down": [p.turned_down or None for p in parts],
            "walls_mm_at_25_percent_less_and_more_mass": [
                p.walls_25 and [rounded(1e3 * wall) for wall in p.walls_25] for p in parts
            ],
            "beam_section_mm": [
                {key: rounded(1e3 * q.si) for key, q in p.section.section if isinstance(q, PositiveLength)}
                | {"kind": p.section.section.kind}
                for p in parts
            ],
        }
    by = {quantity: numbers(row) for quantity, row in values.items()}
    return Table(
        "links", "The links", labels, by, {}, {quantity: numbers(row) for quantity, row in more.items()}, extra
    )


def _walls(shells: Sequence[MadeShell]) -> Table:
    """Walls, what they rest on, and what a mass that is 25 % off does."""
    changes = []
    for one in shells:
        less = one.walls_25 if isinstance(one, ImportedPart) else None
        known = less is not None and min(less) > 0.0
        ratios = [(one.wall / wall) ** one.verdict.trust.wall_exponent for wall in less or ()] if known else []
        changes.append(" / ".join(f"{100.0 * (ratio - 1.0):+.0f} %" for ratio in ratios) or "–")
    labels = {
        "link": [one.name for one in shells],
        "from": [one.basis.words for one in shells],
        "change_of_tilt_with_25_%_less_/_more_mass": changes,
    }
    title = "Where the wall thicknesses come from"
    return Table("walls", title, labels, {WALL: np.array([one.wall for one in shells])}, folded=True, is_extract=True)


def _solids(solids: Sequence[MadeSolid], arm: fem.arm.Arm) -> Table:
    tips = {
        part.name: float(np.linalg.eigvalsh(part.element.flexibility[:3, :3])[-1])
        for part in (arm.model.links if solids else ())
    }
    labels = {
        "link": [one.name for one in solids],
        "file": [one.source for one in solids],
        "seats": [_rings(one.solid.rings) for one in solids],
    }
    values = {
        TETRAHEDRA: np.array([len(one.solid.mesh.tetrahedra) for one in solids]),
        MASS: np.array([one.kg for one in solids]),
        Quantity("tip_compliance", "um/kN", 1e9, "tip"): np.array([tips[one.name] for one in solids]),
    }
    extra: dict[str, Sequence[Any]] = {
        "rings": [_rings_json(one.solid.rings) for one in solids],
        "changes": [list(one.solid.report) for one in solids],
    }
    return Table("solids", "Solids", labels, values, {}, {SIZE: np.array([one.solid.size for one in solids])}, extra)


def _how_sure(shells: Sequence[MadeShell]) -> str:
    """To what factor the links' compliance is known."""
    if not shells:
        return "The compliance of a solid is as accurate as its modulus and its seats: a few per cent."
    bases = {one.basis.basis for one in shells}
    if bases == {"given"}:
        known = "The compliance of the links is as accurate as the wall thicknesses that you gave."
    elif bases <= {"mass", "given"}:
        known = "With wall thicknesses from masses, the compliance of a link is known to within a factor of about 1.5."
    else:
        known = "Without its mass, the compliance of a link is known to within a factor of about 3; with it, about 1.5."
    return f"{known} CAD files of the links (STEP) would reduce this to a few per cent."


def warnings_of(made: MadeShell, compliance: TipCompliance) -> list[str]:
    """All warnings of one link: departure first, then what the gate says, then shell against beam."""
    said = [line for line in made.link.report if line.startswith("WARNING")]
    soft = compliance.warning()
    return [*said, *made.verdict.warnings, *([soft] if soft else [])]


def as_description(result: RobotImport, folder: Path) -> ModelDescription:
    """Write the shells into ``folder`` and describe the robot with them; surface files as absolute paths.

    A URDF's masses that are less than the casings weigh are fillings for simulators, and left out.
    """
    given = result.urdf.description
    notes = [*result.notes, *(f"link {name} stays rigid: {why}" for name, why in result.rigid.items())]
    light = [part.name for part in result.parts if part.declared is not None and part.declared.si < part.casing_kg]
    if light:
        notes.append(f"masses of the URDF left out: lighter than the casings alone ({', '.join(light)})")
    links = [_described(part, result.material, bool(light), folder) for part in result.parts]
    data = given.model_dump(by_alias=True, exclude_none=True)
    kinds = "meshes of the URDF: " + ", ".join(s for part in result.parts for s in part.sources)
    data |= {
        "sources": {**given.sources, SOURCE: kinds},
        "materials": {result.material: result.figures},
        "link": links,
        "notes": notes,
    }
    if light:
        data.pop("mass", None)
    description = ModelDescription.model_validate(data)
    check_shells(description)
    return description


def _described(part: ImportedPart, material: str, without_mass: bool, folder: Path) -> Link:
    up = [float(v) + 0.0 for v in np.round(part.section.up, 9)]
    note = "centroids of the imported surface's sections"
    path = [
        Position(value=tuple(float(v) + 0.0 for v in np.round(1e3 * p, 3)), unit="mm", source="derived", note=note)
        for p in part.section.path
    ]
    return Link(
        name=part.name,
        body=part.body,
        material=material,
        section=part.section.section,
        beam_up=(up[0], up[1], up[2]),
        rigid_to=path[0],
        via=tuple(path[1:-1]),
        rigid_from=path[-1],
        mass=None if without_mass else part.declared,
        surface=None if part.verdict.kind == "refused" else written_surface(part, folder, SOURCE),
    )


def written_surface(shell: MadeShell, folder: Path, source: str) -> Surface:
    """Save a shell into ``folder`` and say what it is."""
    unnamed = folder / "surface.npz"
    sha256 = save_shell(shell.link.mesh, unnamed)
    path = unnamed.replace(folder / surface_file_name(shell.name, sha256))
    return Surface(
        file=str(path.resolve()),
        sha256=sha256,
        wall=PositiveLength(
            # Short links are all boss.
            value=round(1e3 * max(shell.wall, float(shell.link.mesh.thickness.min())), 6),
            unit="mm",
            source="definition" if shell.basis.basis == "given" else "assumed",
            note=f"{shell.basis.words}; thicker in bosses",
        ),
        size=PositiveLength(value=round(1e3 * shell.link.figures.size_m, 3), unit="mm", source="derived"),
        source=source,
        changes=shell.link.report,
    )


def check_shells(description: ModelDescription) -> None:
    """Read the shells back as a model does; raises InputError where one does not fit its link."""
    robot = robot_from(description)
    for link in description.link:
        if link.surface is not None:
            link_shell_mesh(link, link_beam_mesh(description, robot, link))
