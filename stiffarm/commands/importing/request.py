"""What the user asks of an import, and the materials it knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from fem.arm import Arm
from meshes.surfaces.reading import STEP_SUFFIXES, SUFFIXES
from meshes.surfaces.routes import Repair
from robots import InputError, require_one_of, require_positive
from robots.schema.description import Material
from robots.schema.quantities import Density, Modulus, PoissonsRatio
from stiffarm.request import NAMES, PAIR, POSE, READINGS, TEXT, Kind, Request, argument, option, united, word
from stiffarm.session.parsing import refuse_given

# Young's modulus (GPa), Poisson's ratio, density (kg/m^3): usual figures of structural steel, a cast aluminium
# alloy and spheroidal graphite iron. Which alloy a casing is made of is not known from its mesh.
MATERIALS = {"steel": (210.0, 0.3, 7850.0), "aluminium": (70.0, 0.33, 2700.0), "cast-iron": (170.0, 0.28, 7100.0)}
LIMITS = (("--youngs-modulus-GPa", 1.0, 1000.0), ("--poissons-ratio", 0.0, 0.49), ("--density", 100.0, 25000.0))
URDF = ".urdf"
OF_ONE_LINK = ("model", "link", "scale")
OF_ALL = (
    *("tip", "base", "rigid", "wall", "mass_kg", "step", "radius"),
    *("material", "youngs_modulus_GPa", "poissons_ratio", "density"),
)


def _lengths(value: Any, name: str) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise InputError(
            name, code="A004", value=value, allowed="lengths by link, as in forearm=8", remedy="name links"
        )
    for link, length in value.items():
        require_positive(f"{name}: {link} (mm)", length, code="L011")
    return dict(value)


def _step_files(value: Any, name: str) -> dict[str, Path]:
    for link, path in value.items():
        if Path(path).suffix.lower() not in STEP_SUFFIXES:
            remedy = "name the link and its STEP file"
            raise InputError(name, code="A007", value=f"{link}={path}", allowed="link=file.step", remedy=remedy)
    return {link: Path(path) for link, path in value.items()}


def _files_by_link(text: str, name: str) -> dict[str, str]:
    return united([PAIR.read(one, name) for one in text.split(",")], name)


LENGTHS = Kind("LINK=MM,...", POSE.read, _lengths, POSE.text)
STEP_FILES = Kind("LINK=FILE,...", _files_by_link, _step_files, PAIR.text)


@dataclass(frozen=True, kw_only=True)
class ImportRequest(Request):
    """Build a model from a URDF, or one link from a surface file.

    A URDF with its meshes becomes a model with shell links; a file of one link becomes that link of an existing model:
    a shell, or a solid from STEP and from surfaces of the material itself.

    Examples
    --------
    >>> import stiffarm as sa
    >>> sa.import_arm("missing.urdf")
    Traceback (most recent call last):
    robots.errors.InputError: SOURCE: got 'missing.urdf'; allowed: an existing file. To fix it: check the path
    """

    source: Path | str = argument(
        "A URDF with its meshes, or one link: its surface (STL, OBJ, PLY, DAE) or its solid (STEP).",
        READINGS,
        metavar="SOURCE",
        required=True,
    )
    wall_mm: float | None = option(
        "Wall thickness of all casings, in mm. Default: by each link's mass, else by the arm's, else 6; the model's "
        "value when importing one link."
    )
    wall: Mapping[str, float] | None = option(
        "Wall thickness of individual links, in mm, as in upper_arm=8,forearm=6.", LENGTHS
    )
    size_mm: float | None = option("Element size, in mm. Default: chosen for about 10,000 elements per link.")
    close_mm: float | None = option("Openings up to this width are closed, in mm. Default: found by trial.")
    material: str | None = option(
        "Material of all links: steel, aluminium or cast-iron. Default: steel, or aluminium where walls of steel would "
        "be thinner than 3 mm by the links' masses; the model's when importing one link."
    )
    youngs_modulus_GPa: float | None = option(  # noqa: N815 - its unit
        "Young's modulus, in GPa. Default: the usual value of the material.", spelled=("--youngs-modulus-GPa",)
    )
    poissons_ratio: float | None = option("Poisson's ratio. Default: the usual value of the material.")
    density: float | None = option("Density, in kg/m^3. Default: the usual value of the material.")
    tip: str | None = option("URDF link at the end of the arm. Default: where the most revolute joints lead.")
    base: str | None = option("URDF link at the base of the arm. Default: the root link.")
    boss: float | None = option(
        "Wall thickness of the bosses around joints, as a multiple of the wall beside them. Default: 2.5, and 1 on "
        "convex hulls."
    )
    mass_kg: float | None = option(
        "Mass of the whole arm, in kg; gives the wall thickness if the links have no masses."
    )
    meshes: Literal["auto", "visual", "collision"] = option(
        "URDF meshes to use: visual, collision, or auto: visual, and collision where these fail.",
        word(Literal["auto", "visual", "collision"]),
        default="auto",
    )
    rigid: Sequence[str] | None = option("Links to leave rigid, separated by commas, as in hand,link_4.", NAMES)
    step: Mapping[str, Path | str] | None = option(
        "STEP files of links that are solids, each in its link's frame, as in upper_arm=arm.step (needs the optional "
        "extra `solid`).",
        STEP_FILES,
    )
    radius: Mapping[str, float] | None = option(
        "Radius of the rings at which links are held, in mm, as in forearm=80 or forearm.tip=60.", LENGTHS
    )
    repair: Repair = option(
        "Surface repair: auto (only if needed), none (accept only clean surfaces) or wrap (always wrap).",
        word(Repair),
        default="auto",
    )
    wrap: Literal["auto", "alpha", "grid"] = option(
        "Wrapping method: auto, grid or alpha (alpha needs the optional extra `wrap`).",
        word(Literal["auto", "alpha", "grid"]),
        default="auto",
    )
    model: Arm | Path | str | None = option("When importing one link: the model it belongs to.", TEXT)
    link: str | None = option("When importing one link: its name in the model.")
    scale: float | None = option("When importing one link: length of one file unit in metres, as in 0.001 for mm.")

    def __post_init__(self) -> None:
        super().__post_init__()
        path, suffixes = Path(self.source), (URDF, *SUFFIXES, *STEP_SUFFIXES)
        if path.suffix.lower() not in suffixes:
            raise InputError("SOURCE", code="A007", value=str(path), allowed=", ".join(suffixes))
        if not path.is_file():
            raise InputError(
                "SOURCE", code="A007", value=str(path), allowed="an existing file", remedy="check the path"
            )
        require_positive("--mass-kg", self.mass_kg, code="L011")
        for name in ("wall_mm", "size_mm", "close_mm", "scale", "boss"):
            require_positive(f"--{name.replace('_', '-')}", getattr(self, name), code="L011")
        self.figures(self.material or "steel")
        why = "leave it out: " + (
            "a URDF names its links and scales itself"
            if self.is_robot
            else "the file is one link of a model, which has the link's material"
        )
        unfit = self.given(*(OF_ONE_LINK if self.is_robot else OF_ALL))
        refuse_given(dict.fromkeys(unfit, "given"), "not for this SOURCE", why)
        if not self.is_robot and (self.model is None or self.link is None):
            remedy = "say which, with --model MODEL --link NAME; `stiffarm robots MODEL` shows a model"
            raise InputError(f"{path.name} is one link", code="A009", remedy=remedy)

    @property
    def writes_by(self) -> str:
        """The command writes files."""
        return "import"

    @property
    def is_robot(self) -> bool:
        """Whether the source is a robot, not one link."""
        return Path(self.source).suffix.lower() == URDF

    @property
    def size(self) -> float | None:
        """Size of elements, m."""
        return None if self.size_mm is None else 1e-3 * self.size_mm

    def wall_of(self, *names: str) -> float | None:
        """The wall (m) of a link of one of these names; None where none is given."""
        value = next((self.wall[name] for name in names if self.wall and name in self.wall), self.wall_mm)
        return None if value is None else 1e-3 * value

    def radius_of(self, *names: str) -> float | None:
        """The radius (m) of the rings of a link of one of these names, or of one of its rings."""
        return next((1e-3 * self.radius[name] for name in names if self.radius and name in self.radius), None)

    def figures(self, name: str) -> Material:
        """The material of that name, with figures of its own where they are given.

        Raises
        ------
        InputError
            Unknown name, or figures out of range.
        """
        require_one_of("--material", name, MATERIALS, code="L011", remedy="choose the nearest of them")
        given = (self.youngs_modulus_GPa, self.poissons_ratio, self.density)
        for (spelled, low, high), value in zip(LIMITS, given, strict=True):
            if value is not None and not low <= value <= high:
                raise InputError(
                    spelled, code="L011", value=value, allowed=f"{low:g} to {high:g}", remedy="look at its unit"
                )
        E, nu, rho = (usual if own is None else own for usual, own in zip(MATERIALS[name], given, strict=True))
        notes = [f"usual for {name}" if own is None else "given to the import" for own in given]
        return Material(
            youngs_modulus=Modulus(value=E, unit="GPa", source="assumed", note=notes[0]),
            poissons_ratio=PoissonsRatio(value=nu, unit="1", source="assumed", note=notes[1]),
            density=Density(value=rho, unit="kg/m^3", source="assumed", note=notes[2]),
        )
