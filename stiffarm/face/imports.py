"""Imports: an arm from a URDF with its meshes, or one link of an arm from a surface file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

from robots import InputError, require_positive
from stiffarm.face.arms import Arm, Picture, load
from stiffarm.face.calls import called
from stiffarm.face.shown import Shown, frame

if TYPE_CHECKING:
    import pandas as pd

    from stiffarm.session.outputs import OutputFolder

Repair = Literal["auto", "none", "wrap"]
Wrap = Literal["auto", "grid", "alpha"]


@dataclass(frozen=True, repr=False)
class Imported(Shown):
    """An imported arm with shell links: ``folder`` holds model.toml with its meshes, import.json and a picture."""

    arm: Arm
    folder: Path
    content: Mapping[str, Any]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to look at before the links are relied upon."""
        return tuple(f"{link['link']}: {line}" for link in self._links() for line in link["warnings"])

    def title(self) -> str:
        """Robot, number of links, and how many warnings there are."""
        links, warnings = len(self._links()), len(self.warnings)
        counted = f"{links} shell link{'s' * (links != 1)}, {warnings} warning{'s' * (warnings != 1)}"
        return f"Import of {self.arm.name}: {counted}"

    def to_frame(self) -> pd.DataFrame:
        """One row a link: wall, element size, triangles, least angle, tip compliance as a shell over that as a beam."""
        columns = (
            "link",
            "wall_mm",
            "wall_basis",
            "verdict",
            "size_mm",
            "triangles",
            "minimum_angle_deg",
            "tip_compliance_shell_over_beam",
        )
        return frame([{name: link[name] for name in columns} for link in self._links()])

    def plot(self, file: str | Path | None = None) -> Picture:
        """The picture of the imported links; ``file``: a PNG to write."""
        return Picture((self.folder / "import.png").read_bytes()).kept(file)

    def _links(self) -> Sequence[Mapping[str, Any]]:
        links: Sequence[Mapping[str, Any]] = self.content.get("links", (self.content,))
        return links


def import_arm(
    urdf: str | Path,
    folder: str | Path,
    *,
    wall_mm: float | Mapping[str, float] | None = None,
    size_mm: float | None = None,
    close_mm: float | None = None,
    material: str | None = None,
    youngs_modulus_GPa: float | None = None,
    poissons_ratio: float | None = None,
    density: float | None = None,
    tip: str | None = None,
    base: str | None = None,
    boss: float | None = None,
    mass_kg: float | None = None,
    meshes: Literal["auto", "visual", "collision"] = "auto",
    rigid: Sequence[str] = (),
    radius_mm: Mapping[str, float] | None = None,
    repair: Repair = "auto",
    wrap: Wrap = "auto",
) -> Imported:
    """Build an arm with shell links from a URDF with its meshes.

    Parameters
    ----------
    urdf : the URDF
    folder : where model.toml and meshes/ go; it is created if needed
    wall_mm : wall thickness of all casings, or of links by name; default: by the links' masses, else the arm's, else 6
    size_mm : element size; default: chosen for about 10,000 elements per link
    close_mm : openings up to this width are closed; default: found by trial
    material : of all links, "steel", "aluminium" or "cast-iron"; default: steel, or aluminium where walls of
        steel would be thinner than 3 mm by the links' masses
    youngs_modulus_GPa, poissons_ratio, density : of the material (density in kg/m^3); default: its usual values
    tip, base : URDF links at the ends of the arm; default: where the most revolute joints lead, the root link
    boss : wall of the bosses around joints over the wall beside them; default: 2.5, and 1 on convex hulls
    mass_kg : of the whole arm, for its walls where the links have no masses
    meshes : URDF meshes to use; "auto": visual ones, and collision meshes where these fail
    rigid : links to leave rigid
    radius_mm : radius of the rings that links are held at, by link or as in "forearm.tip"
    repair : of surfaces, "auto" (only if needed), "none" (accept only clean ones) or "wrap" (always wrap)
    wrap : wrapping method

    Raises
    ------
    InputError
        A URDF or meshes that cannot be used: all faults at once.

    Examples
    --------
    >>> import stiffarm as sa
    >>> sa.import_arm("missing.urdf", "out")
    Traceback (most recent call last):
    robots.errors.InputError: URDF missing.urdf cannot be read (it does not exist). To fix it: check the path
    """
    from robots.urdf.reading import read_urdf
    from stiffarm.commands.importing.options import ImportOptions, MaterialChoice
    from stiffarm.commands.importing.results import write_robot
    from stiffarm.commands.importing.step import import_robot

    walls = wall_mm if isinstance(wall_mm, Mapping) else {}
    with called():
        description = read_urdf(urdf, tip=tip, base=base)
        options = ImportOptions(
            material=MaterialChoice(material, youngs_modulus_GPa, poissons_ratio, density),
            wall=_metres("wall_mm", None if isinstance(wall_mm, Mapping) else wall_mm),
            boss=boss,
            robot_kg=mass_kg,
            walls={name: _metres(f"wall_mm: {name}", value) for name, value in walls.items()},
            rigid=tuple(rigid),
            radius={name: _metres(f"radius_mm: {name}", value) for name, value in (radius_mm or {}).items()},
            size=_metres("size_mm", size_mm),
            opening=_metres("close_mm", close_mm),
            meshes=meshes,
            repair=repair,
            wrap=wrap,
        )
        with _folder(folder, "import_arm", Path(urdf)) as out:
            content = write_robot(import_robot(description, options), out)
    return _imported(folder, content)


def import_link(
    arm: Arm,
    surface: str | Path,
    link: str,
    folder: str | Path,
    *,
    wall_mm: float | None = None,
    size_mm: float | None = None,
    close_mm: float | None = None,
    scale: float | None = None,
    repair: Repair = "auto",
    wrap: Wrap = "auto",
) -> Imported:
    """Make one link of an arm a shell from a surface file (STL, OBJ, PLY or DAE), or a solid from STEP.

    Surfaces of the material itself, both sides of its walls, become solids too.

    Parameters
    ----------
    arm : the arm that the link belongs to; it is not changed
    surface : the file, in the frame of the link's body
    link : the link's name in the model
    folder : where model.toml and meshes/ go; it is created if needed
    wall_mm : wall thickness; default: the model's
    size_mm, close_mm, repair, wrap : as of :func:`import_arm`
    scale : length of one unit of the file in metres, as 0.001 for mm; default: the file's own unit, else metres

    Raises
    ------
    InputError
        A surface that cannot be used, or a link that the model does not have.

    Examples
    --------
    >>> import stiffarm as sa
    >>> sa.import_link(sa.load("xr701"), "missing.stl", "upper_arm", "out")
    Traceback (most recent call last):
    robots.errors.InputError: surface: got 'missing.stl'; allowed: an existing file. To fix it: check the path
    """
    from stiffarm.commands.importing.options import ImportOptions
    from stiffarm.commands.importing.results import write_link
    from stiffarm.commands.importing.step import import_into_model

    source = Path(surface)
    if not source.is_file():
        raise InputError(
            "surface", code="A007", value=str(surface), allowed="an existing file", remedy="check the path"
        )
    with called():
        # The link keeps the material that the model gives it.
        options = ImportOptions(
            size=_metres("size_mm", size_mm),
            opening=_metres("close_mm", close_mm),
            repair=repair,
            wrap=wrap,
        )
        wall = _metres("wall_mm", wall_mm)
        with _folder(folder, "import_link", source) as out:
            done = import_into_model(source, arm.description, link, options, scale, wall)
            content = write_link(done, arm.description, source.name, out)
    return _imported(folder, content)


def _folder(folder: str | Path, step: str, source: Path) -> OutputFolder:
    from stiffarm.session.outputs import OutputFolder

    return OutputFolder(Path(folder), [f"stiffarm.{step}"], {"source": source}, None)


def _imported(folder: str | Path, content: Mapping[str, Any]) -> Imported:
    kind: Literal["shell", "solid"] = "solid" if content.get("solids") else "shell"
    return Imported(load(Path(folder) / "model.toml", links=kind), Path(folder), content)


@overload
def _metres(argument: str, value_mm: float) -> float: ...
@overload
def _metres(argument: str, value_mm: float | None) -> float | None: ...
def _metres(argument: str, value_mm: float | None) -> float | None:
    require_positive(f"{argument} (mm)", value_mm, code="B003")
    return None if value_mm is None else 1e-3 * value_mm
