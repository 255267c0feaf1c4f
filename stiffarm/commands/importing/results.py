"""What an import leaves: the model with its shells, figures as JSON, and a table for people."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from fem import build_model
from meshes import link_beam_mesh, link_shell_mesh, save_shell
from meshes.surfaces.link import GOOD, quality_words
from robots import ModelDescription, Remark, save_description
from robots.library.surface_files import surface_file_name
from robots.robot import robot_from
from robots.schema.description import Link, Surface
from robots.schema.quantities import Position, PositiveLength
from stiffarm.commands.importing import solids
from stiffarm.commands.importing.checks import TipCompliance, tip_compliances, warnings_of
from stiffarm.commands.importing.figures import contact_sheet
from stiffarm.commands.importing.report import write_report
from stiffarm.commands.importing.solids import MadeSolid, with_solids
from stiffarm.commands.importing.step import ImportedPart, MadeShell, RobotImport
from stiffarm.pages.style import save_png
from stiffarm.session.console import say, say_notes, show_table
from stiffarm.session.outputs import OutputFolder

SOURCE = "meshes"


def write_robot(result: RobotImport, folder: OutputFolder) -> dict[str, Any]:
    """Write model, shells, figures and picture of an imported robot; returns what import.json holds."""
    # The model takes copies of the shells with it, under names that tell versions apart.
    with tempfile.TemporaryDirectory() as shells:
        description = with_solids(as_description(result, Path(shells)), result.solids, Path(shells), SOURCE)
        found = tip_compliances(description, tuple(part.name for part in result.parts))
        warnings = {part.name: warnings_of(part, found[part.name]) for part in result.parts}
        said = [
            Remark(f"link {name}: {line}", code=getattr(line, "code", ""))
            for name, lines in warnings.items()
            for line in lines
        ]
        description = description.model_copy(update={"notes": (*description.notes, *said)})
        content = payload(result, description, found)
        facts = [_facts(part, warnings[part.name]) for part in result.parts]
        pieces = [*(part.piece for part in result.parts), *(made.piece for made in result.solids)]
        facts += [solids.facts(made) for made in result.solids]
        _write(description, content, contact_sheet(pieces, facts, f"Imported links: {description.title}"), folder)
    write_report(description, content, content["links"], folder)
    return content


def write_link(
    done: MadeShell | MadeSolid, given: ModelDescription, source: str, folder: OutputFolder
) -> dict[str, Any]:
    """Write a model with the new shell or solid of one link; returns what import.json holds."""
    name, key = done.name, f"surface of {done.name}"
    content = {"schema": "stiffarm-import/1", "robot": given.name, "link": name, "file": source}
    if isinstance(done, MadeSolid):
        return _write_solid(done, given, content, folder)
    with tempfile.TemporaryDirectory() as shells:
        surface = written_surface(done, Path(shells), key)
        data = given.model_dump(by_alias=True, exclude_none=True)
        data["sources"][key] = f"{source}, prepared by stiffarm import"
        data["link"] = [
            link.model_copy(update={"surface": surface}) if link.name == name else link for link in given.link
        ]
        description = ModelDescription.model_validate(data)
        check_shells(description)
        found = tip_compliances(description, (name,))[name]
        content |= link_payload(done, found)
        sheet = contact_sheet([done.piece], [_facts(done, content["warnings"])], f"{source} as link {name}")
        _write(description, content, sheet, folder)
    write_report(description, content, [content], folder)
    return content


def _write_solid(
    done: MadeSolid, given: ModelDescription, content: dict[str, Any], folder: OutputFolder
) -> dict[str, Any]:
    key = f"solid of {done.name}"
    with tempfile.TemporaryDirectory() as meshes:
        data = given.model_dump(by_alias=True, exclude_none=True)
        data["sources"][key] = f"{done.source}, prepared by stiffarm import"
        described = with_solids(ModelDescription.model_validate(data), [done], Path(meshes), key)
        # Read back as a model does.
        model = build_model(described, "solid")
        tip = next(part.element.flexibility[:3, :3] for part in model.links if part.name == done.name)
        softest = _um_per_kn(float(np.linalg.eigvalsh(tip)[-1]))
        content |= {"solids": [solids.payload(done) | {"tip_compliance_um_per_kN": softest}], "warnings": []}
        sheet = contact_sheet([done.piece], [solids.facts(done)], f"{done.source} as link {done.name}")
        _write(described, content, sheet, folder)
    write_report(described, content, [], folder)
    return content


def _write(description: ModelDescription, content: dict[str, Any], sheet: Figure, folder: OutputFolder) -> None:
    save_description(description, folder.path("model.toml"))
    folder.write_json("import.json", content)
    save_png(sheet, folder.path("import.png"))


def _facts(shell: MadeShell, warnings: Sequence[str]) -> list[str]:
    """What stands under the picture of a shell."""
    figures = shell.link.figures
    rings = ", ".join(f"{key} {1e3 * ring.radius:.0f} mm" for key, ring in figures.rings.items())
    how = "wrapped" if figures.wrapped else "as it is"
    mesh = f"{figures.triangles} triangles, wall {1e3 * shell.wall:g} mm, surface {how}"
    how = f"{how}, {shell.verdict.kind}"
    said = [f"{len(warnings)} WARNING{'S' if len(warnings) > 1 else ''}: see import.json"] if warnings else []
    return [mesh, f"rings: {rings}", *said]


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


def payload(result: RobotImport, description: ModelDescription, found: Mapping[str, TipCompliance]) -> dict[str, Any]:
    """What import.json holds of a robot."""
    return {
        "schema": "stiffarm-import/1",
        "robot": result.urdf.description.name,
        "material": result.material,
        "links": [_payload_of(part, found[part.name]) for part in result.parts],
        "solids": [solids.payload(made) for made in result.solids],
        "rigid": result.rigid,
        "notes": list(description.notes),
    }


def _payload_of(part: ImportedPart, found: TipCompliance) -> dict[str, Any]:
    section = part.section.section
    return {
        "link": part.name,
        "body": part.body,
        "files": list(part.sources),
        "meshes": part.kind,
        "meshes_turned_down": part.turned_down or None,
        "walls_mm_at_25_percent_less_and_more_mass": None if part.walls_25 is None else [_mm(w) for w in part.walls_25],
        "span_mm": _mm(part.span),
        "casing_mass_kg": round(part.casing_kg, 3),
        "urdf_mass_kg": None if part.declared is None else part.declared.si,
        "beam_section_mm": {key: _mm(quantity.si) for key, quantity in section if isinstance(quantity, PositiveLength)}
        | {"kind": section.kind},
        "cover": round(part.section.cover, 3),
        **link_payload(part, found),
    }


def link_payload(shell: MadeShell, found: TipCompliance) -> dict[str, Any]:
    """Figures of one imported shell for JSON."""
    figures = shell.link.figures
    return {
        "wall_mm": _mm(shell.wall),
        "wall_basis": shell.basis.basis,
        "wall_words": shell.basis.words,
        "verdict": shell.verdict.kind,
        "half_energy_share": round(shell.verdict.trust.half_energy_share, 5),
        "wall_exponent": round(shell.verdict.trust.wall_exponent, 3),
        "size_mm": _mm(figures.size_m),
        "bodies": figures.bodies,
        "open_edges": figures.open_edges,
        "wrapped": figures.wrapped,
        "triangles": figures.triangles,
        "minimum_angle_deg": round(figures.minimum_angle_deg, 2),
        "quality": quality_words(figures.minimum_angle_deg),
        "mid_surface_area_m2": round(figures.area_m2, 6),
        "departure_mm": [None if math.isnan(v) else _mm(v) for v in figures.departure_m],
        "rings": {
            name: {"nodes": int(ring.nodes.size), "radius_mm": _mm(ring.radius), "chosen": ring.words}
            for name, ring in figures.rings.items()
        },
        "tip_compliance_um_per_kN": {"shell": _um_per_kn(found.shell), "beam": _um_per_kn(found.beam)},
        "tip_compliance_shell_over_beam": round(found.ratio, 3) if math.isfinite(found.ratio) else None,
        "warnings": warnings_of(shell, found),
        "changes": list(shell.link.report),
    }


def _um_per_kn(value: float) -> float:
    return float(f"{1e9 * value:.6g}")


def _mm(value: float) -> float:
    return round(1e3 * value, 3)


def show(result: RobotImport, content: Mapping[str, Any]) -> None:
    """Tables of the links for people, then what stays rigid and the remarks."""
    show_table(
        f"Imported: {result.urdf.description.title}",
        ["link", "bodies", "open edges", "surface", "triangles", "size (mm)", "least angle (deg)"],
        [_mesh_row(part) for part in result.parts],
    )
    show_table(
        "The links",
        ["link", "wall (mm)", "rings (mm)", "verdict", "off by (mm)", "casing (kg)", "URDF (kg)", "shell / beam"],
        [_link_row(part, link) for part, link in zip(result.parts, content["links"], strict=True)],
    )
    say("off by: 95 % of the visible original surface is closer than this to the shell's outer side")
    say("verdict: whether the link's stiffness as a shell can be trusted, judged by where its strain energy is")
    say("shell / beam: tip compliance as a shell divided by that as a beam")
    for part in result.parts:
        words = quality_words(part.link.figures.minimum_angle_deg)
        if words != GOOD:
            say(f"quality of {part.name}: {words}")
    for note in content["notes"]:
        if ": WARNING: " in note:
            say(note)
        else:
            say_notes([note])


def _mesh_row(part: ImportedPart) -> list[str]:
    figures = part.link.figures
    return [
        part.name,
        f"{figures.bodies}",
        f"{figures.open_edges}",
        "wrapped" if figures.wrapped else "as it is",
        f"{figures.triangles}",
        f"{1e3 * figures.size_m:.3g}",
        f"{figures.minimum_angle_deg:.0f}{'' if quality_words(figures.minimum_angle_deg) == GOOD else ' POOR'}",
    ]


def _link_row(part: ImportedPart, link: Mapping[str, Any]) -> list[str]:
    off = part.link.figures.departure_m[0]
    return [
        part.name,
        f"{1e3 * part.wall:.3g}",
        ", ".join(f"{1e3 * ring.radius:.0f}" for ring in part.link.figures.rings.values()),
        part.verdict.kind,
        "-" if math.isnan(off) else f"{1e3 * off:.3g}",
        f"{part.casing_kg:.3g}",
        "-" if part.declared is None else f"{part.declared.si:.4g}",
        "-" if link["tip_compliance_shell_over_beam"] is None else f"{link['tip_compliance_shell_over_beam']:.3g}",
    ]
