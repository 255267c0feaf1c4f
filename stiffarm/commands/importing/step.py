"""Links from surface files: a URDF with meshes becomes a model with shell links, or one file a model's link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from meshes import section_dimensions
from meshes.beams import body_index
from meshes.link_sections import EquivalentSection, equivalent_section
from meshes.surfaces.bodies import BodySurface, link_interfaces, surface_samples
from meshes.surfaces.doubts import is_hull
from meshes.surfaces.link import ImportedLink, MidSurface, Rings, mid_surface, shell_on
from meshes.surfaces.reading import STEP_SUFFIXES, read_surface
from meshes.surfaces.rings import Interface, one_bearing
from meshes.surfaces.routes import ImportSettings
from meshes.surfaces.seats import ALONG
from meshes.surfaces.walls import (
    BOSS,
    USUAL_WALL,
    Casing,
    Wall,
    areas_of,
    boss_elements,
    masses_at_fault,
    material_by_mass,
    walls_of,
)
from robots import InputError, InputErrors, ModelDescription, Remark, Robot
from robots.arrays import Array
from robots.progress import Progress, report_progress
from robots.robot import robot_from
from robots.schema.description import Material
from robots.schema.quantities import Mass
from robots.urdf.reading import UrdfRobot
from stiffarm.commands.importing.bodies import SPAN_RATIO, Bodies, bodies_of, expected_span
from stiffarm.commands.importing.gate import Verdict, judged
from stiffarm.commands.importing.request import ImportRequest
from stiffarm.commands.importing.solids import MadeSolid, Piece, from_file, of_material, solid_settings


@dataclass(frozen=True)
class MadeShell:
    """The shell made for a link, by its name: its wall (m) and its interfaces' points (i, 3) m, in its rings' order.

    ``verdict``: whether it may be trusted. ``basis``: what its wall rests on.
    """

    name: str
    link: ImportedLink
    wall: float
    points: Array
    verdict: Verdict
    basis: Wall

    @property
    def piece(self) -> Piece:
        """What is drawn of it."""
        mesh = self.link.mesh
        return Piece(self.name, mesh.nodes, mesh.triangles, mesh.interfaces, self.points)


@dataclass(frozen=True)
class ImportedPart(MadeShell):
    """A body of a URDF that became a link.

    ``declared``: its mass in the URDF. ``sources``: its files, of ``kind`` "visual" or "collision"; ``turned_down``:
    why not the kind that comes first. ``walls_25``: its wall (m) with 25 % less and more mass, None where it does not
    rest on mass.
    """

    body: str
    section: EquivalentSection
    casing_kg: float
    declared: Mass | None
    sources: tuple[str, ...]
    kind: str = "visual"
    turned_down: str = ""
    walls_25: tuple[float, float] | None = None

    @property
    def span(self) -> float:
        """Way from root to tip, m."""
        return float(np.linalg.norm(self.points[1] - self.points[0]))


@dataclass(frozen=True)
class RobotImport:
    """An imported robot: its parts, its material, which bodies stay rigid and why, and what is a solid as well."""

    urdf: UrdfRobot
    parts: tuple[ImportedPart, ...]
    rigid: dict[str, str]
    notes: tuple[str, ...]
    material: str
    figures: Material
    solids: tuple[MadeSolid, ...]


@dataclass(frozen=True)
class _Draft:
    """A body on its way: its mid-surface, the meshes it was made from, where it is held."""

    body: str
    index: int
    name: str
    surface: MidSurface
    interfaces: dict[str, Interface]
    rings: Rings
    kind: str
    turned_down: str
    own: BodySurface
    declared: Mass | None

    @property
    def tube(self) -> bool:
        """Whether it turns about its own length, as forearm tubes do, which carry no drive."""
        way = self.interfaces["tip"].point - self.interfaces["root"].point
        axis = self.interfaces["root"].axis
        return axis is not None and self.index > 0 and abs(float(axis @ way)) >= ALONG * float(np.linalg.norm(way))

    @cached_property
    def hull(self) -> bool:
        """Whether its surface is the hull of a link."""
        return is_hull(self.surface.mesh.nodes, self.surface.mesh.faces)

    def boss(self, asked: float | None) -> float:
        """Walls of its bosses over the barrel's: as asked for, else usual ones, which a hull does not show."""
        return asked if asked is not None else 1.0 if self.hull else BOSS

    def casing(self, asked: float | None) -> Casing:
        """What its wall is taken from; ``asked``: walls of bosses over the barrel's, None for usual ones."""
        mesh, rings = self.surface.mesh, self.rings.by_name
        boss = boss_elements(mesh.nodes, mesh.faces, self.interfaces, rings)
        areas = areas_of(mesh.nodes, mesh.faces, boss, rings, self.boss(asked))
        return Casing(areas, None if self.declared is None else self.declared.si, self.tube, self.hull)


def import_robot(urdf: UrdfRobot, asked: ImportRequest, progress: Progress | None = None) -> RobotImport:
    """Make a shell of every body of a URDF robot that has shapes and a way between its joints.

    Raises
    ------
    InputError
        Names in the request that no link has; all links that could not be imported, at once.
    """
    robot = robot_from(urdf.description)
    bodies = bodies_of(urdf, robot, asked)
    faults = list(bodies.lost)
    drafts: list[_Draft] = []
    for i, body in enumerate(bodies.links):
        report_progress(progress, i, len(bodies.links))
        try:
            drafts.append(_draft(urdf, robot, bodies, body, asked))
        except InputErrors as error:
            faults += error.errors
        except InputError as error:
            faults.append(error)
    if faults:
        raise InputErrors(
            f"import of {urdf.description.name} (mend the files, or leave links rigid with --rigid NAME,...)", faults
        )
    if not drafts:
        raise InputError(
            f"import of {urdf.description.name}: no link became a shell",
            code="L010",
            value="; ".join(f"{bodies.names[body]}: {why}" for body, why in bodies.rigid.items()),
            remedy=f"look for {asked.meshes} meshes in the file, or choose the other kind with --meshes",
        )
    drafts = _with_one_bearing(drafts)
    material, figures, walls, said = _walls(drafts, asked)
    parts = tuple(_part(draft, walls[draft.name], figures, asked) for draft in drafts)
    solids, more = _solids(robot, drafts, figures, asked)
    lost = asked.meshes if asked.meshes != "auto" else "visual"
    notes = [*urdf.notes, *(note for _, note in urdf.missing.get(lost, ())), *said, *more]
    rigid = {bodies.names[body]: why for body, why in bodies.rigid.items()}
    return RobotImport(urdf, parts, rigid, tuple(notes), material, figures, solids)


def _solids(
    robot: Robot, drafts: Sequence[_Draft], figures: Material, asked: ImportRequest
) -> tuple[tuple[MadeSolid, ...], list[str]]:
    """Solids of the links that have a file for it, or meshes of the material itself; and what is to be said."""
    made, said, faults, files = [], [], [], dict(asked.step or {})
    for draft in drafts:
        # Seats are whole faces, unless they are given: not the larger rings that mend shells.
        interfaces = {
            key: replace(
                one, radius=asked.radius_of(f"{draft.name}.{key}", f"{draft.body}.{key}", draft.name, draft.body)
            )
            for key, one in draft.interfaces.items()
        }
        settings = solid_settings(figures, asked.size, expected_span(robot, draft.body), SPAN_RATIO)
        file = files.get(draft.name, files.get(draft.body))
        try:
            if file is None:
                solid, words = of_material(draft.name, draft.own, interfaces, figures, settings)
            else:
                solid, words = from_file(draft.name, Path(file), interfaces, figures, settings), None
        except InputError as error:
            faults.append(error)
            continue
        made += [] if solid is None else [solid]
        said += [] if words is None else [words]
        if solid is not None and draft.declared is not None and solid.kg > draft.declared.si:
            said.append(
                f"link {draft.name}: its solid weighs {solid.kg:.3g} kg, the URDF says {draft.declared.si:.3g} kg"
            )
    if faults:
        raise InputErrors("solids of links", faults)
    lost = set(files) - {name for draft in drafts for name in (draft.name, draft.body)}
    if lost:
        names = ", ".join(draft.name for draft in drafts)
        raise InputError(
            "--step: link", code="L010", value=min(lost), allowed=names, remedy="name links that are not rigid"
        )
    return tuple(made), said


def _draft(urdf: UrdfRobot, robot: Robot, bodies: Bodies, body: str, asked: ImportRequest) -> _Draft:
    """Mid-surface and rings of a body, from the first kind of its meshes that gives a casing."""
    index, name = body_index(robot, body), bodies.names[body]
    neighbours = (bodies.seen(index - 1), bodies.seen(index + 1))
    before, after = (None if one is None else surface_samples(one) for one in neighbours)
    interfaces = {
        key: replace(one, radius=asked.radius_of(f"{name}.{key}", f"{body}.{key}", name, body))
        for key, one in link_interfaces(robot, index, before, after).items()
    }
    points = np.stack([one.point for one in interfaces.values()])
    wall = asked.wall_of(name, body) or USUAL_WALL
    settings = _settings(asked, wall, asked.figures("steel"), expected_span(robot, body))
    errors = list(bodies.faults[body])
    for kind, own in bodies.surfaces[body].items():
        try:
            surface = mid_surface(name, own.nodes, own.faces, points, settings, own.notes)
            rings = surface.rings(interfaces)
        except InputError as error:
            errors.append(error)
            continue
        turned_down = errors[0].what if errors else ""
        return _Draft(body, index, name, surface, interfaces, rings, kind, turned_down, own, urdf.masses.get(body))
    raise InputErrors(f"link {name}", errors) if len(errors) > 1 else errors[0]


def _settings(asked: ImportRequest, wall: float, figures: Material, span: float | None) -> ImportSettings:
    return ImportSettings(
        wall,
        figures.youngs_modulus.si,
        figures.poissons_ratio.si,
        asked.size,
        asked.repair,
        None if asked.close_mm is None else 1e-3 * asked.close_mm,
        asked.wrap,
        expected_span=span,
        span_ratio=SPAN_RATIO,
        boss=BOSS if asked.boss is None else asked.boss,
    )


def _with_one_bearing(drafts: list[_Draft]) -> list[_Draft]:
    """Give the smaller ring of a joint the larger one's radius, where they differ by much."""
    by_index = {draft.index: i for i, draft in enumerate(drafts)}
    out = list(drafts)
    for draft in drafts:
        after = by_index.get(draft.index + 1)
        if after is None:
            continue
        here = by_index[draft.index]
        for i, key, radius in one_bearing(
            out[here].rings.by_name["tip"], out[after].rings.by_name["root"], here, after
        ):
            given = out[i].interfaces[key]
            if given.radius is not None:
                continue
            interfaces = out[i].interfaces | {key: replace(given, radius=radius)}
            try:
                out[i] = replace(out[i], rings=out[i].surface.rings(interfaces))
            except InputError:
                continue  # no room for it: the ring stays as it was
    return out


def _walls(drafts: list[_Draft], asked: ImportRequest) -> tuple[str, Material, dict[str, Wall], list[str]]:
    """Material and wall of each link, and what is to be said of both."""
    casings = {draft.name: draft.casing(asked.boss) for draft in drafts}
    lightest = asked.figures(asked.material or "aluminium").density.si
    fault = masses_at_fault(casings, lightest)
    said: list[str] = []
    if fault is not None:
        said.append(Remark(f"WARNING: masses of the URDF not used: {fault}", code="W026"))
    by_mass = "steel" if fault else material_by_mass(casings, asked.figures("steel").density.si)
    name = asked.material or by_mass
    figures = asked.figures(name)
    given = {draft.name: asked.wall_of(draft.name, draft.body) for draft in drafts}
    walls = walls_of(
        casings,
        {key: value for key, value in given.items() if value is not None},
        figures.density.si,
        asked.mass_kg,
        fault is None,
    )
    if asked.material is None and name == "aluminium":
        said.append("material: aluminium, because walls of steel would be thinner than 3 mm by the links' masses")
    return name, figures, walls, said


def _part(draft: _Draft, wall: Wall, figures: Material, asked: ImportRequest) -> ImportedPart:
    settings = replace(_settings(asked, wall.metres, figures, None), boss=draft.boss(asked.boss))
    points = np.stack([one.point for one in draft.interfaces.values()])

    def shell(interfaces: Mapping[str, Interface], rings: Rings) -> ImportedLink:
        return shell_on(draft.surface, interfaces, rings, settings)

    link, verdict = judged(draft.surface, draft.interfaces, draft.rings, points, shell, draft.hull)
    mesh = link.mesh
    first, last = (_beam_end(draft, link, key) for key in ("root", "tip"))
    section = equivalent_section(draft.name, mesh.nodes, mesh.triangles, wall.metres, first, last, mesh.thickness)
    casing = draft.casing(asked.boss)
    density = figures.density.si
    kg = casing.areas.kg(wall.metres, density)
    quarter = None
    if wall.basis == "mass" and casing.kg is not None:
        quarter = (casing.wall(0.75 * casing.kg, density), casing.wall(1.25 * casing.kg, density))
    return ImportedPart(
        draft.name,
        link,
        wall.metres,
        points,
        verdict,
        wall,
        draft.body,
        section,
        kg,
        draft.declared,
        draft.own.sources,
        draft.kind,
        draft.turned_down,
        quarter,
    )


def _beam_end(draft: _Draft, link: ImportedLink, key: str) -> Array:
    """Where a beam ends (3,) m: on the joint's axis, level with the seat if the axis runs along the link."""
    here, ring = draft.interfaces[key], link.figures.rings[key]
    if here.axis is None or ring.across or not ring.seat:
        return here.point
    axis = here.axis / np.linalg.norm(here.axis)
    middle = link.mesh.nodes[ring.nodes].mean(axis=0)
    return np.asarray(here.point + axis * float(axis @ (middle - here.point)))


def import_into_model(description: ModelDescription, asked: ImportRequest) -> MadeShell | MadeSolid:
    """Shell of one link of a model from a file in the link's body frame, of the model's material.

    A solid where the file is STEP, or its surface that of the material itself.

    Raises
    ------
    InputError
        No such link, or what :func:`meshes.surfaces.link.prepare_link` refuses.
    """
    path, name, wall = Path(asked.source), str(asked.link), asked.wall_of()
    found = [link for link in description.link if link.name == name]
    if not found:
        known = ", ".join(link.name for link in description.link) or "none: the model has rigid bodies only"
        raise InputError("--link", code="L010", value=name, allowed=known, remedy="name a link of the model")
    link, robot = found[0], robot_from(description)
    material = description.materials[link.material]
    thickness = float(section_dimensions(link.section)[-1]) if wall is None else wall
    settings = replace(_settings(asked, thickness, material, None), span_ratio=ImportSettings.span_ratio)
    interfaces = link_interfaces(robot, body_index(robot, link.body))
    meshed = solid_settings(material, asked.size)
    if path.suffix.lower() in STEP_SUFFIXES:
        return from_file(name, path, interfaces, material, meshed, asked.scale)
    nodes, faces, notes = read_surface(path, asked.scale)
    solid, words = of_material(
        name, BodySurface(nodes, faces, (path.name,), tuple(notes)), interfaces, material, meshed
    )
    if solid is not None and wall is None:
        return solid
    notes += [] if words is None else [words]
    points = np.stack([one.point for one in interfaces.values()])
    surface = mid_surface(name, nodes, faces, points, settings, tuple(notes))
    shell, verdict = judged(
        surface, interfaces, surface.rings(interfaces), points, lambda i, r: shell_on(surface, i, r, settings)
    )
    basis = Wall(thickness, "given", "as given" if wall is not None else "that of the model's section")
    return MadeShell(name, shell, thickness, points, verdict, basis)
