"""Links from surface files: a URDF with meshes becomes a model with shell links, or one file a model's link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from meshes import section_dimensions, shell_mass
from meshes.beams import body_index, body_tip
from meshes.link_sections import EquivalentSection, equivalent_section
from meshes.surfaces.bodies import BodySurface, body_surface, link_interfaces, surface_samples
from meshes.surfaces.link import ImportedLink, prepare_link
from meshes.surfaces.reading import check_scale, read_surface
from meshes.surfaces.routes import ImportSettings, Repair
from meshes.surfaces.seats import ALONG
from robots import InputError, InputErrors, ModelDescription, Robot, require_one_of
from robots.arrays import Array
from robots.progress import Progress, report_progress
from robots.robot import robot_from
from robots.schema.description import Material
from robots.schema.quantities import Density, Mass, Modulus, PoissonsRatio
from robots.urdf.reading import UrdfRobot, Visual

# Young's modulus (GPa), Poisson's ratio, density (kg/m^3): usual figures of structural steel, a cast aluminium
# alloy and spheroidal graphite iron. Which alloy a casing is made of is not known from its mesh.
MATERIALS = {"steel": (210.0, 0.3, 7850.0), "aluminium": (70.0, 0.33, 2700.0), "cast-iron": (170.0, 0.28, 7100.0)}
# Joints this near to each other, over the longest way between two, have a wrist body between them.
SHORT = 0.08
# Of the way from root to tip, that a body's shapes must span.
LEAST_COVER = 0.3
# Bodies are as large as their joints are apart, give or take; beyond, the unit of length is in doubt.
SPAN_RATIO = (0.1, 12.0)
Meshes = Literal["visual", "collision"]
Wrap = Literal["auto", "alpha", "grid"]
NAMES_OF_PARTS = ("base", "tool", "bar", "crank")


@dataclass(frozen=True)
class ImportOptions:
    """What the user asks of an import; lengths in m.

    ``walls``, ``rigid``: by link, named as in the URDF or by its joint. ``size`` None: some ten thousand
    elements a link. ``radius``: by link, of the interfaces' discs.
    """

    material: str
    figures: Material
    wall: float
    walls: Mapping[str, float] = field(default_factory=dict)
    rigid: tuple[str, ...] = ()
    radius: Mapping[str, float] = field(default_factory=dict)
    size: float | None = None
    opening: float | None = None
    meshes: Meshes = "visual"
    repair: Repair = "auto"
    wrap: Wrap = "auto"


@dataclass(frozen=True)
class MadeShell:
    """The shell made for a link, by its name: its wall (m) and its interfaces' points (i, 3) m, in its rings' order."""

    name: str
    link: ImportedLink
    wall: float
    points: Array


@dataclass(frozen=True)
class ImportedPart(MadeShell):
    """A body of a URDF that became a shell. ``declared``: its mass in the URDF. ``sources``: its files."""

    body: str
    section: EquivalentSection
    casing_kg: float
    declared: Mass | None
    sources: tuple[str, ...]

    @property
    def span(self) -> float:
        """Way from root to tip, m."""
        return float(np.linalg.norm(self.points[1] - self.points[0]))


@dataclass(frozen=True)
class RobotImport:
    """An imported robot: its parts, and which bodies stay rigid and why."""

    urdf: UrdfRobot
    parts: tuple[ImportedPart, ...]
    rigid: dict[str, str]
    notes: tuple[str, ...]


def material_of(
    name: str, youngs_modulus_GPa: float | None, poissons_ratio: float | None, density: float | None
) -> Material:
    """A material by name, with figures of its own where they are given.

    Raises
    ------
    InputError
        Unknown name, or figures out of range.
    """
    require_one_of("--material", name, MATERIALS, remedy="choose the nearest of them")
    given = (youngs_modulus_GPa, poissons_ratio, density)
    limits = (("--youngs-modulus-GPa", 1.0, 1000.0), ("--poissons-ratio", 0.0, 0.49), ("--density", 100.0, 25000.0))
    for (option, low, high), value in zip(limits, given, strict=True):
        if value is not None and not low <= value <= high:
            raise InputError(option, value=value, allowed=f"{low:g} to {high:g}", remedy="look at its unit")
    E, nu, rho = (usual if own is None else own for usual, own in zip(MATERIALS[name], given, strict=True))
    notes = [f"usual for {name}" if own is None else "given to the import" for own in given]
    return Material(
        youngs_modulus=Modulus(value=E, unit="GPa", source="assumed", note=notes[0]),
        poissons_ratio=PoissonsRatio(value=nu, unit="1", source="assumed", note=notes[1]),
        density=Density(value=rho, unit="kg/m^3", source="assumed", note=notes[2]),
    )


def import_robot(urdf: UrdfRobot, options: ImportOptions, progress: Progress | None = None) -> RobotImport:
    """Make a shell of every body of a URDF robot that has shapes and a way between its joints.

    Raises
    ------
    InputError
        Names in the options that no link has; all links that could not be imported, at once.
    """
    robot = robot_from(urdf.description)
    shapes = urdf.visuals if options.meshes == "visual" else urdf.collisions
    names = link_names(robot, shapes)
    _check_names(names, options, urdf)
    faults = _missing_files(urdf, options)
    surfaces: dict[str, BodySurface] = {}
    for body, visuals in shapes.items():
        try:
            surfaces[body] = body_surface(visuals)
        except InputError as error:
            if not {names[body], body} & set(options.rigid):
                faults.append(error)
    for body in list(surfaces):
        try:
            _check_scale(robot, body, names[body], surfaces[body], options)
        except InputError as error:
            faults.append(error)
            del surfaces[body]
    jobs, rigid = _sorted_out(robot, names, surfaces, options)
    parts: list[ImportedPart] = []
    for i, body in enumerate(jobs):
        report_progress(progress, i, len(jobs))
        try:
            parts.append(_part(robot, body, names[body], surfaces, urdf.masses.get(body), options))
        except InputError as error:
            faults.append(error)
    if faults:
        raise InputErrors(
            f"import of {urdf.description.name} (mend the files, or leave links rigid with --rigid NAME,...)", faults
        )
    if not parts:
        raise InputError(
            f"import of {urdf.description.name}: no link became a shell",
            value="; ".join(f"{names[body]}: {why}" for body, why in rigid.items()),
            remedy=f"look for {options.meshes} meshes in the file, or choose the other kind with --meshes",
        )
    notes = [*urdf.notes, *(note for _, note in urdf.missing[options.meshes])]
    return RobotImport(urdf, tuple(parts), {names[body]: why for body, why in rigid.items()}, tuple(notes))


def link_names(robot: Robot, shapes: Mapping[str, Sequence[Visual]]) -> dict[str, str]:
    """Names of the bodies' links: the URDF's own where the model has no other part of that name."""
    taken = {*robot.joint_names, *NAMES_OF_PARTS}
    names: dict[str, str] = {}
    for body in ("base", *robot.joint_names):
        own = next((visual.link for visual in shapes.get(body, ()) if visual.link), body)
        while own in taken:
            own = f"{own}_link"
        taken.add(own)
        names[body] = own
    return names


def _check_names(names: Mapping[str, str], options: ImportOptions, urdf: UrdfRobot) -> None:
    known = {*names, *names.values(), *(link for link, _ in urdf.missing[options.meshes])}
    for option, given in (("--wall", options.walls), ("--rigid", options.rigid), ("--radius", options.radius)):
        for name in given:
            if name not in known:
                raise InputError(
                    f"{option}: link", value=name, allowed=", ".join(names.values()), remedy="name links as the URDF"
                )


def _missing_files(urdf: UrdfRobot, options: ImportOptions) -> list[InputError]:
    return [
        InputError(note, remedy="put the file there, or set ROS_PACKAGE_PATH to the folder of the package")
        for link, note in urdf.missing[options.meshes]
        if link not in options.rigid
    ]


def _expected_span(robot: Robot, body: str) -> float:
    """How large a body should be (m): as its joints are apart, where that is not much less than for others."""
    longest = max(float(np.linalg.norm(T[:3, 3])) for T in robot.T_pre)
    return max(float(np.linalg.norm(body_tip(robot, body_index(robot, body)))), 0.25 * longest)


def _check_scale(robot: Robot, body: str, name: str, surface: BodySurface, options: ImportOptions) -> None:
    """Refuse shapes in a wrong unit: small ones would else pass as too short to matter."""
    if {name, body} & set(options.rigid):
        return
    try:
        check_scale(name, surface.nodes, np.zeros((1, 3)), _expected_span(robot, body), SPAN_RATIO)
    except InputError as error:
        remedy = f"{error.remedy}; in a URDF that is <mesh ... scale=...>"
        raise InputError(error.what, value=error.value, allowed=error.allowed, remedy=remedy) from error


def _sorted_out(
    robot: Robot, names: Mapping[str, str], surfaces: Mapping[str, BodySurface], options: ImportOptions
) -> tuple[list[str], dict[str, str]]:
    """Bodies to make shells of, and the others with the reason why they stay rigid."""
    bodies = ("base", *robot.joint_names)
    ends = {body: link_interfaces(robot, i) for i, body in enumerate(bodies)}
    tips = {body: both["tip"].point for body, both in ends.items()}
    longest = max(float(np.linalg.norm(tip)) for tip in tips.values())
    jobs, rigid = [], {}
    for body in bodies:
        span = float(np.linalg.norm(tips[body]))
        if {names[body], body} & set(options.rigid):
            rigid[body] = "asked for"
        elif body not in surfaces:
            rigid[body] = f"no {options.meshes} mesh"
        elif span <= SHORT * longest:
            rigid[body] = f"root and tip only {1e3 * span:.3g} mm apart"
        elif (cover := _cover(surfaces[body].nodes, tips[body], ends[body]["root"].axis)) < LEAST_COVER:
            rigid[body] = f"its shapes span {100 * cover:.0f} % of the way from root to tip"
        else:
            jobs.append(body)
    return jobs, rigid


def _cover(nodes: Array, tip: Array, axis: Array | None) -> float:
    """Share of the way from the origin to ``tip`` that the nodes span.

    A joint whose axis runs along the way may have its origin anywhere on it: the way then begins where the nodes do.
    """
    share = nodes @ tip / (tip @ tip)
    first, last = max(float(share.min()), 0.0), min(float(share.max()), 1.0)
    along = axis is not None and abs(float(axis @ tip)) >= ALONG * float(np.linalg.norm(axis) * np.linalg.norm(tip))
    return max(last - first, 0.0) / (max(1.0 - first, 1e-9) if along else 1.0)


def _part(
    robot: Robot,
    body: str,
    name: str,
    surfaces: Mapping[str, BodySurface],
    declared: Mass | None,
    options: ImportOptions,
) -> ImportedPart:
    index = body_index(robot, body)
    bodies = ("base", *robot.joint_names)
    around = [bodies[i] if 0 <= i < len(bodies) else "" for i in (index - 1, index + 1)]
    before, after = (surface_samples(surfaces[other]) if other in surfaces else None for other in around)
    radius = options.radius.get(name, options.radius.get(body))
    interfaces = {key: replace(one, radius=radius) for key, one in link_interfaces(robot, index, before, after).items()}
    wall = options.walls.get(name, options.walls.get(body, options.wall))
    settings = ImportSettings(
        wall,
        options.figures.youngs_modulus.si,
        options.figures.poissons_ratio.si,
        options.size,
        options.repair,
        options.opening,
        options.wrap,
        expected_span=_expected_span(robot, body),
        span_ratio=SPAN_RATIO,
    )
    own = surfaces[body]
    link = prepare_link(name, own.nodes, own.faces, interfaces, settings, own.notes)
    section = equivalent_section(name, link.mesh.nodes, link.mesh.triangles, wall, np.zeros(3), interfaces["tip"].point)
    casing = shell_mass(link.mesh, options.figures.density.si).kg
    points = np.stack([one.point for one in interfaces.values()])
    return ImportedPart(name, link, wall, points, body, section, casing, declared, own.sources)


def import_into_model(
    path: Path,
    description: ModelDescription,
    name: str,
    options: ImportOptions,
    scale: float | None = None,
    wall: float | None = None,
) -> MadeShell:
    """Shell of one link of a model from a file in the link's body frame, of the model's material.

    ``scale``: metres for one unit of the file; None takes the file's own, else metres. ``wall`` m; None takes that
    of the link's section.

    Raises
    ------
    InputError
        No such link, or what :func:`meshes.surfaces.link.prepare_link` refuses.
    """
    found = [link for link in description.link if link.name == name]
    if not found:
        known = ", ".join(link.name for link in description.link) or "none: the model has rigid bodies only"
        raise InputError("--link", value=name, allowed=known, remedy="name a link of the model")
    link, robot = found[0], robot_from(description)
    material = description.materials[link.material]
    thickness = float(section_dimensions(link.section)[-1]) if wall is None else wall
    settings = ImportSettings(
        thickness,
        material.youngs_modulus.si,
        material.poissons_ratio.si,
        options.size,
        options.repair,
        options.opening,
        options.wrap,
    )
    nodes, faces, notes = read_surface(path, scale)
    interfaces = link_interfaces(robot, body_index(robot, link.body))
    shell = prepare_link(name, nodes, faces, interfaces, settings, tuple(notes))
    return MadeShell(name, shell, thickness, np.stack([one.point for one in interfaces.values()]))
