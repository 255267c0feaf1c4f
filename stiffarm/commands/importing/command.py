"""Robots and links from surface files: `import`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from meshes.surfaces.reading import STEP_SUFFIXES, SUFFIXES
from robots import InputError, content_hash, require_positive
from robots.urdf.reading import read_urdf
from stiffarm.session.console import progress, say
from stiffarm.session.frame import command
from stiffarm.session.options import Debug, Json
from stiffarm.session.parsing import parse_pairs, parse_word, refuse_given
from stiffarm.session.table_kinds import described


def import_command(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A URDF with its meshes, or one link: its surface (STL, OBJ, PLY, DAE) or its solid (STEP).",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder for model.toml and meshes/; it is created if needed.")],
    wall_mm: Annotated[
        float | None,
        typer.Option(
            "--wall-mm",
            help="Wall thickness of all casings, in mm. Default: by each link's mass, else by the arm's, else 6; the "
            "model's value when importing one link.",
        ),
    ] = None,
    wall: Annotated[
        str | None,
        typer.Option("--wall", help="Wall thickness of individual links, in mm, as in upper_arm=8,forearm=6."),
    ] = None,
    size_mm: Annotated[
        float | None,
        typer.Option("--size-mm", help="Element size, in mm. Default: chosen for about 10,000 elements per link."),
    ] = None,
    close_mm: Annotated[
        float | None,
        typer.Option("--close-mm", help="Openings up to this width are closed, in mm. Default: found by trial."),
    ] = None,
    material: Annotated[
        str | None,
        typer.Option(
            "--material",
            help="Material of all links: steel, aluminium or cast-iron. Default: steel, or aluminium where walls of "
            "steel would be thinner than 3 mm by the links' masses; the model's when importing one link.",
        ),
    ] = None,
    youngs_modulus: Annotated[
        float | None,
        typer.Option("--youngs-modulus-GPa", help="Young's modulus, in GPa. Default: the usual value of the material."),
    ] = None,
    poissons_ratio: Annotated[
        float | None,
        typer.Option("--poissons-ratio", help="Poisson's ratio. Default: the usual value of the material."),
    ] = None,
    density: Annotated[
        float | None, typer.Option("--density", help="Density, in kg/m^3. Default: the usual value of the material.")
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option("--tip", help="URDF link at the end of the arm. Default: where the most revolute joints lead."),
    ] = None,
    base: Annotated[
        str | None, typer.Option("--base", help="URDF link at the base of the arm. Default: the root link.")
    ] = None,
    boss: Annotated[
        float | None,
        typer.Option(
            "--boss",
            help="Wall thickness of the bosses around joints, as a multiple of the wall beside them. Default: "
            "2.5, and 1 on convex hulls.",
        ),
    ] = None,
    mass_kg: Annotated[
        float | None,
        typer.Option(
            "--mass-kg", help="Mass of the whole arm, in kg; gives the wall thickness if the links have no masses."
        ),
    ] = None,
    meshes: Annotated[
        str,
        typer.Option(
            "--meshes", help="URDF meshes to use: visual, collision, or auto: visual, and collision where these fail."
        ),
    ] = "auto",
    rigid: Annotated[
        str | None, typer.Option("--rigid", help="Links to leave rigid, separated by commas, as in hand,link_4.")
    ] = None,
    step: Annotated[
        str | None,
        typer.Option(
            "--step",
            help="STEP files of links that are solids, each in its link's frame, as in upper_arm=arm.step (needs the "
            "optional extra `solid`).",
        ),
    ] = None,
    radius: Annotated[
        str | None,
        typer.Option(
            "--radius", help="Radius of the rings at which links are held, in mm, as in forearm=80 or forearm.tip=60."
        ),
    ] = None,
    repair: Annotated[
        str,
        typer.Option(
            "--repair",
            help="Surface repair: auto (only if needed), none (accept only clean surfaces) or wrap (always wrap).",
        ),
    ] = "auto",
    wrap: Annotated[
        str,
        typer.Option("--wrap", help="Wrapping method: auto, grid or alpha (alpha needs the optional extra `wrap`)."),
    ] = "auto",
    model: Annotated[
        str | None, typer.Option("--model", help="When importing one link: the model it belongs to.")
    ] = None,
    link: Annotated[str | None, typer.Option("--link", help="When importing one link: its name in the model.")] = None,
    scale: Annotated[
        float | None,
        typer.Option("--scale", help="When importing one link: length of one file unit in metres, as in 0.001 for mm."),
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Build a model from a URDF, or one link from a surface file.

    A URDF with its meshes becomes a model with shell links; a file of one link becomes that link of an existing model:
    a shell, or a solid from STEP and from surfaces of the material itself.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        from meshes.surfaces.routes import Repair
        from stiffarm.commands.importing import results as import_results
        from stiffarm.commands.importing import step as importing
        from stiffarm.commands.importing.options import ImportOptions, MaterialChoice, Meshes, Wrap
        from stiffarm.commands.importing.solids import MadeSolid

        suffix = source.suffix.lower()
        if suffix not in (".urdf", *SUFFIXES, *STEP_SUFFIXES):
            allowed = ", ".join((".urdf", *SUFFIXES, *STEP_SUFFIXES))
            raise InputError("SOURCE", code="A007", value=str(source), allowed=allowed)
        if not source.is_file():
            raise InputError(
                "SOURCE", code="A007", value=str(source), allowed="an existing file", remedy="check the path"
            )
        lengths = {"--wall-mm": wall_mm, "--size-mm": size_mm, "--close-mm": close_mm, "--scale": scale}
        for option, value in lengths.items():
            require_positive(option, value, code="L011")
        require_positive("--boss", boss, code="L011")
        require_positive("--mass-kg", mass_kg, code="L011")
        chosen = MaterialChoice(material, youngs_modulus, poissons_ratio, density)
        chosen.figures(material or "steel")
        options = ImportOptions(
            material=chosen,
            wall=_metres(wall_mm),
            boss=boss,
            robot_kg=mass_kg,
            walls=_by_link(wall, "--wall"),
            rigid=tuple(part.strip() for part in rigid.split(",")) if rigid else (),
            solids=_files(step, "--step"),
            radius=_by_link(radius, "--radius"),
            size=_metres(size_mm),
            opening=_metres(close_mm),
            meshes=parse_word(meshes, get_args(Meshes), "--meshes"),
            repair=parse_word(repair, get_args(Repair), "--repair"),
            wrap=parse_word(wrap, get_args(Wrap), "--wrap"),
        )
        if suffix == ".urdf":
            refuse_given(
                {"--model": model, "--link": link, "--scale": scale},
                "not for this SOURCE",
                "leave it out: a URDF names its links and scales itself",
            )
            urdf = read_urdf(source, tip=tip, base=base)
            frame.reads(source=source)
            with frame.folder() as folder:
                with progress("links") as bar, folder.timed("links"):
                    result = importing.import_robot(urdf, options, bar)
                content = import_results.write_robot(result, folder)
            import_results.show(result, content)
        else:
            robot_only: dict[str, Any] = {"--tip": tip, "--base": base, "--rigid": rigid, "--wall": wall}
            robot_only |= {"--mass-kg": mass_kg, "--step": step}
            robot_only |= {"--radius": radius, "--material": material, "--youngs-modulus-GPa": youngs_modulus}
            robot_only |= {"--poissons-ratio": poissons_ratio, "--density": density}
            refuse_given(
                robot_only,
                "not for this SOURCE",
                "leave it out: the file is one link of a model, which has the link's material",
            )
            if model is None or link is None:
                raise InputError(
                    f"{source.name} is one link",
                    code="A009",
                    remedy="say which, with --model MODEL --link NAME; `stiffarm robots MODEL` shows a model",
                )
            given = described(model)
            frame.files |= {"source": source, "model": content_hash(given)}
            with frame.folder() as folder:
                done = importing.import_into_model(source, given, link, options, scale, _metres(wall_mm))
                content = import_results.write_link(done, given, source.name, folder)
            report = done.solid.report if isinstance(done, MadeSolid) else done.link.report
            for line in (*report, *(w for w in content["warnings"] if w not in report)):
                say(line)
        frame.answer(content)


def _metres(value_mm: float | None) -> float | None:
    return None if value_mm is None else 1e-3 * value_mm


def _files(text: str | None, option: str) -> dict[str, Path]:
    """Files from ``link=path,link=path``."""
    found: dict[str, Path] = {}
    for item in text.split(",") if text is not None else ():
        name, _, path = (part.strip() for part in item.partition("="))
        if not name or not path or Path(path).suffix.lower() not in STEP_SUFFIXES:
            raise InputError(
                option, code="A007", value=item, allowed="link=file.step", remedy="name the link and its STEP file"
            )
        found[name] = Path(path)
    return found


def _by_link(text: str | None, option: str) -> dict[str, float]:
    """Lengths in m from ``name=mm,name=mm``; the names are checked against the robot's later."""
    if text is None:
        return {}
    names = tuple(item.partition("=")[0].strip() for item in text.split(","))
    values = parse_pairs(text, option, names)
    for name, value in values.items():
        require_positive(f"{option}: {name} (mm)", value, code="L011")
    return {name: 1e-3 * value for name, value in values.items()}
