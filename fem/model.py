"""The mechanical model of an arm: condensed links, joint springs, load path. Immutable."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fem.elements import beam
from fem.elements.condensation import Superelement, condense
from fem.elements.couplings import rigidly_at
from fem.springs import RIGID, ConstantSpring, SpringLaw, spring_from
from meshes import (
    BeamMesh,
    ShellMesh,
    SolidMesh,
    beam_mass,
    casing_mesh,
    crank_beam_mesh,
    link_beam_mesh,
    link_shell_mesh,
    link_solid_mesh,
    section_dimensions,
    section_properties,
)
from meshes.beams import body_index
from robots import InputError, LoadPath, ModelDescription, Robot, require_one_of
from robots.arrays import Array
from robots.robot import as_designed, robot_from
from robots.schema.description import FlangeCoupling, Joint, Link, PlaceStiffness
from robots.schema.quantities import Angles, Position, RotationalStiffness

if TYPE_CHECKING:
    from fem.effects.secant import Secants

LinkKind = Literal["rigid", "beam", "shell", "solid"]
LINK_KINDS: tuple[LinkKind, ...] = ("rigid", "beam", "shell", "solid")
# Names of parts that are no links.
PLACES = ("base", "tool", "bar", "crank")
FLANGES: tuple[FlangeCoupling, ...] = ("rigid", "distributing")
# Links of beams that were built in this process, so many at most.
BEAM_PARTS = 256
_beam_parts: dict[Hashable, LinkPart] = {}


@dataclass(frozen=True)
class LinkPart:
    """A flexible link: the body it is (0 = base), its condensed FE model, its beam, and its shell if it is one.

    ``shell``: the mesh, of a solid link the solid's. ``flanges``: how its interfaces were coupled to their points, by
    name; rigid where nothing is said.
    """

    name: str
    body: int
    element: Superelement
    mesh: BeamMesh
    shell: ShellMesh | SolidMesh | None = None
    flanges: Mapping[str, FlangeCoupling] = field(default_factory=dict)


@dataclass(frozen=True)
class JointPart:
    """The springs of one joint.

    ``axial``: law about the joint axis. ``bearing`` (6, 6): constant compliance of the joint frame's translations
    x, y, z (m/N) and rotations x, y, z (rad/(N m)), zero where it is rigid; its last diagonal entry is zero, for
    that is the axial spring's. ``housing`` (6, 6): the same of what does not turn with the joint: axes of the joint's
    frame at zero, fixed in the body before it. ``laws``: row (0 to 4) of the bearing's axes and a compliance there
    that varies with the pose, on top.
    """

    name: str
    joint: int
    axial: SpringLaw
    bearing: Array
    housing: Array = field(default_factory=lambda: np.zeros((6, 6)))
    laws: tuple[tuple[int, SpringLaw], ...] = ()

    @property
    def other(self) -> Array:
        """Compliances (5,) of the bearing one by one, without those off the diagonal."""
        return np.diag(self.bearing)[:5].copy()

    def springs_about(self, row: int) -> list[SpringLaw]:
        """The springs that may vary in a row of its axes, 0 to 5: the axial one, or the bearing's laws."""
        return [self.axial] if row == 5 else [law for given, law in self.laws if given == row]

    @property
    def is_coupled(self) -> bool:
        """Whether forces and moments across the axis turn the joint about it, and the other way round."""
        return bool(self.bearing[5].any())


@dataclass(frozen=True)
class BarPart:
    """The parallelogram's bar (axial compliance, m/N) and its crank (None when rigid)."""

    compliance: float
    crank: LinkPart | None


@dataclass(frozen=True)
class BodyMass:
    """A mass that moves with a body (0 = base): ``kg``, centre (3,) m in the body's frame."""

    body: int
    kg: float
    centre: Array


@dataclass(frozen=True, eq=False)
class ArmModel:
    """Everything the statics of an arm need. ``bar`` is None for the serial load path.

    ``base`` (6, 6): compliance of the base about its origin, base axes; ``tool`` (6, 6): of the tool or a force
    sensor at the model's tool point, flange axes; zero is rigid. ``load_offset`` (3,) m, flange axes, and
    ``load_tilt`` (3,) rad, fixed-axis angles about the base's axes: where a test load really acts, from the read
    point, and how its direction is off (:func:`fem.statics.loads.placed`). ``load_point`` (3,) m, flange axes: what
    points that readings bring themselves are off by. ``masses``: of the links, as declared. ``secants``: effects that
    are in it as compliances at a stated load (:func:`fem.effects.secant.with_secants`).
    """

    robot: Robot
    link_kind: LinkKind
    load_path: LoadPath
    links: tuple[LinkPart, ...]
    joints: tuple[JointPart, ...]
    bar: BarPart | None
    base: Array = field(default_factory=lambda: np.zeros((6, 6)))
    tool: Array = field(default_factory=lambda: np.zeros((6, 6)))
    load_offset: Array = field(default_factory=lambda: np.zeros(3))
    load_tilt: Array = field(default_factory=lambda: np.zeros(3))
    load_point: Array = field(default_factory=lambda: np.zeros(3))
    masses: tuple[BodyMass, ...] = ()
    secants: Secants | None = None

    @property
    def as_designed(self) -> ArmModel:
        """The model without errors of zeros and geometry, as the arm's controller has it."""
        return self if self.robot.errors is None else replace(self, robot=as_designed(self.robot))

    def with_joint(self, name: str, **changes: Any) -> ArmModel:
        """Copy with fields of one joint's part changed."""
        return replace(self, joints=tuple(replace(j, **changes) if j.name == name else j for j in self.joints))

    def with_springs(self, springs: Mapping[str, SpringLaw | float]) -> ArmModel:
        """Copy with other laws about the joint axes; numbers are N m/rad.

        Raises
        ------
        InputError
            A joint of that name does not exist.
        """
        unknown = sorted(set(springs) - set(self.robot.joint_names))
        if unknown:
            raise InputError("joint", code="M001", value=unknown[0], allowed=", ".join(self.robot.joint_names))
        laws: dict[str, SpringLaw] = {
            name: ConstantSpring(float(s)) if isinstance(s, Real | int | float) else s for name, s in springs.items()
        }
        return replace(self, joints=tuple(replace(j, axial=laws[j.name]) if j.name in laws else j for j in self.joints))

    def with_rigid_joints(self) -> ArmModel:
        """Copy with joints that do not give way."""
        none = np.zeros((6, 6))
        joints = tuple(replace(j, axial=RIGID, bearing=none, housing=none, laws=()) for j in self.joints)
        return replace(self, joints=joints, secants=None)


def build_model(
    description: ModelDescription,
    links: LinkKind = "beam",
    load_path: LoadPath | None = None,
    flanges: FlangeCoupling | None = None,
) -> ArmModel:
    """Build the mechanical model of a described robot.

    Shell links condensed before come from the user's cache (:mod:`fem.elements.link_cache`).

    Parameters
    ----------
    links : "beam" or "shell" for flexible links, "rigid" for joints alone; "solid" for solids where links have a
        prepared one, shells elsewhere
    load_path : overrides the description's; "parallelogram" needs a robot that has one
    flanges : couples all interfaces of shell links and of the crank so, "rigid" (upper bound of the stiffness) or
        "distributing" (lower bound), see :mod:`fem.elements.couplings`; None: as the description says of each link,
        and rigid where it says nothing; solids too

    Raises
    ------
    InputError
        Unknown kind of links or flanges, a parallelogram asked of a robot without one, a link named like another
        part (a joint, "base", "tool", "bar" or "crank"), flanges of an interface that the link does not have; for
        shell and solid links, what :func:`meshes.link_shell_mesh`, :func:`meshes.link_solid_mesh` and
        :func:`fem.elements.shell.shell_superelement` refuse; solid links of a robot that has no solid at all.
    """
    require_one_of("links", links, LINK_KINDS, code="M003")
    if flanges not in (None, *FLANGES):
        raise InputError("flanges", code="M003", value=flanges, allowed=", ".join(FLANGES))
    robot = robot_from(description)
    path: LoadPath = description.load_path if load_path is None else load_path
    require_one_of("load path", path, ("parallelogram", "serial"), code="M003")
    if path == "parallelogram" and robot.parallelogram is None:
        raise InputError(
            f"load path of {robot.name}", code="M003", value=path, allowed="serial: this robot has no parallelogram"
        )
    taken = {*robot.joint_names, *PLACES} & {link.name for link in description.link}
    if taken:
        raise InputError(
            f"link name of {robot.name}",
            code="M003",
            value=min(taken),
            allowed=f"a name no joint has, and none of {', '.join(PLACES)}",
            remedy="rename the link: deflections are reported by part",
        )
    if links == "solid" and not any(link.solid for link in description.link):
        raise InputError(
            f"links of {robot.name}",
            code="M003",
            value="solid",
            allowed="rigid, beam or shell: none of its links has a solid",
            remedy="import one from STEP: stiffarm import link.step --model MODEL --link NAME --out FOLDER",
        )
    parts: tuple[LinkPart, ...] = ()
    if links != "rigid":
        parts = tuple(_described_link(description, robot, link, links, flanges) for link in description.link)
    return ArmModel(
        robot=robot,
        link_kind=links,
        load_path=path,
        links=parts,
        joints=tuple(_joint_part(robot, i, joint) for i, joint in enumerate(description.joint)),
        bar=_bar_part(description, robot, links, flanges) if path == "parallelogram" else None,
        base=_place(description.base),
        tool=_place(None if description.tool is None else description.tool.stiffness),
        load_offset=_triple(description.load.offset if description.load else None),
        load_tilt=_triple(description.load.tilt if description.load else None),
        load_point=_triple(description.load.point if description.load else None),
        masses=_masses(description, robot),
    )


def _masses(description: ModelDescription, robot: Robot) -> tuple[BodyMass, ...]:
    """Masses of the links that declare one, in the middle of their beams."""
    out = []
    for link in description.link:
        if link.mass is not None:
            mesh = link_beam_mesh(description, robot, link)
            out.append(BodyMass(body_index(robot, link.body), link.mass.si, beam_mass(mesh, 1.0).centre))
    return tuple(out)


def _triple(given: Position | Angles | None) -> Array:
    return np.zeros(3) if given is None else given.si_array


def _place(stiffness: PlaceStiffness | None) -> Array:
    return np.zeros((6, 6)) if stiffness is None else stiffness.compliance


def link_part(description: ModelDescription, model: ArmModel, name: str) -> LinkPart:
    """A link of another description of the same robot, of the kind and with the flanges that ``model`` has."""
    own = next(link for link in description.link if link.name == name)
    before = next(part for part in model.links if part.name == name)
    flanges = own.model_copy(update={"flanges": dict(before.flanges)})
    return _described_link(description, model.robot, flanges, model.link_kind, None)


def _described_link(
    description: ModelDescription, robot: Robot, link: Link, kind: LinkKind, flanges: FlangeCoupling | None
) -> LinkPart:
    mesh, body = link_beam_mesh(description, robot, link), body_index(robot, link.body)
    unknown = [name for name in link.flanges if name not in mesh.interfaces]
    if unknown:
        raise InputError(
            f"flanges of link {link.name}",
            code="M003",
            value=unknown[0],
            allowed=", ".join(mesh.interfaces),
            remedy="remove it: only the link that a parallelogram drives has a pin",
        )
    if kind == "beam":
        return _beam_part(link.name, body, mesh)
    described: dict[str, FlangeCoupling] = {str(name): coupling for name, coupling in link.flanges.items()}
    couplings = {name: flanges or described.get(name, "rigid") for name in mesh.interfaces}
    solid = link_solid_mesh(link, mesh) if kind == "solid" else None
    return _shell_part(link.name, body, mesh, link_shell_mesh(link, mesh) if solid is None else solid, couplings)


def _beam_part(name: str, body: int, mesh: BeamMesh) -> LinkPart:
    """A link of beams; calibrations build an arm again and again, and most of its links are the same."""
    key = (name, body, *map(_hashable, vars(mesh).values()))
    if key not in _beam_parts:
        if len(_beam_parts) >= BEAM_PARTS:
            _beam_parts.clear()
        _beam_parts[key] = _new_beam_part(name, body, mesh)
    return _beam_parts[key]


def _hashable(value: Any) -> Hashable:
    if isinstance(value, dict):
        return tuple((name, _hashable(one)) for name, one in value.items())
    return (value.shape, value.dtype.str, value.tobytes()) if isinstance(value, np.ndarray) else value


def _new_beam_part(name: str, body: int, mesh: BeamMesh) -> LinkPart:
    nodes = np.array(list(mesh.interfaces.values()))
    try:
        element = condense(name, tuple(mesh.interfaces), mesh.nodes[nodes], beam.assemble(mesh), nodes)
    except ArithmeticError as error:
        raise InputError(
            f"link {name}: {error}",
            code="M004",
            allowed="sections, lengths and an elastic modulus that a solver can take together",
            remedy="look for a figure of the link, or of the joints at its ends, that is far too small or too large",
        ) from error
    return LinkPart(name, body, rigidly_at(element, mesh.interface_points), mesh)


def _shell_part(
    name: str, body: int, mesh: BeamMesh, shell: ShellMesh | SolidMesh, flanges: Mapping[str, FlangeCoupling]
) -> LinkPart:
    from fem.elements.link_cache import cached_superelement  # scikit-fem, which shells alone need

    return LinkPart(name, body, cached_superelement(shell, mesh.interface_points, flanges), mesh, shell, flanges)


def _joint_part(robot: Robot, index: int, joint: Joint) -> JointPart:
    axial: SpringLaw
    if joint.stiffness is None:
        axial = RIGID
    elif isinstance(joint.stiffness, RotationalStiffness):
        axial = ConstantSpring(joint.stiffness.si)
    else:
        axial = spring_from(robot, joint.stiffness)
    bearing = np.zeros((6, 6))
    if joint.bearing is not None:
        bearing = joint.bearing.compliance
    if joint.translational_stiffness is not None:
        bearing[[0, 1, 2], [0, 1, 2]] = 1.0 / joint.translational_stiffness.si
    if joint.tilt_stiffness is not None:
        bearing[[3, 4], [3, 4]] = 1.0 / joint.tilt_stiffness.si
    laws = () if joint.bearing_laws is None else joint.bearing_laws.given
    part = JointPart(joint.name, index, axial, bearing, laws=tuple((row, spring_from(robot, law)) for row, law in laws))
    p = robot.parallelogram
    if part.is_coupled and p is not None and index in (p.driven, p.crank_about):
        raise InputError(
            f"bearing of {joint.name}: entries that couple it with the axis",
            code="M004",
            value=bearing[5, :5].tolist(),
            allowed="none at the joints of a parallelogram, whose actuator sits elsewhere",
        )
    return part


def _bar_part(description: ModelDescription, robot: Robot, links: LinkKind, flanges: FlangeCoupling | None) -> BarPart:
    p, geometry = description.parallelogram, robot.parallelogram
    if p is None or geometry is None:
        return BarPart(0.0, None)
    given = None if p.bar_stiffness is None else 1.0 / p.bar_stiffness.si
    if links == "rigid":
        return BarPart(given or 0.0, None)
    material = description.materials[p.bar_material]
    section = section_properties(p.bar.kind, section_dimensions(p.bar), material.poissons_ratio.si)
    length = float(np.linalg.norm(robot.T_pre[geometry.driven][:3, 3]))
    compliance = given or length / (material.youngs_modulus.si * float(section.area))
    mesh, body = crank_beam_mesh(description, robot), geometry.driven + 1
    if links == "beam":
        return BarPart(compliance, _beam_part("crank", body, mesh))
    couplings = dict.fromkeys(mesh.interfaces, flanges or p.crank_flanges)
    return BarPart(compliance, _shell_part("crank", body, mesh, casing_mesh(mesh), couplings))
