"""Robots and links from surface files: `import`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from meshes.surfaces.reading import SUFFIXES
from robots import InputError, content_hash, load_description
from robots.urdf.reading import read_urdf
from stiffarm.session.console import emit_json, progress, say, user_errors
from stiffarm.session.inputs import parse_pairs
from stiffarm.session.options import Debug, Json, output_folder


def import_command(
    source: Annotated[Path, typer.Argument(metavar="SOURCE", help="a URDF, or a STL, OBJ, PLY or DAE of one link")],
    out: Annotated[Path, typer.Option("--out", help="folder for model.toml and meshes/")],
    wall_mm: Annotated[
        float | None, typer.Option("--wall-mm", help="wall of all casings; default: 6, or the model's for one link")
    ] = None,
    wall: Annotated[str | None, typer.Option("--wall", help="walls by link in mm, as in upper_arm=8,forearm=6")] = None,
    size_mm: Annotated[
        float | None, typer.Option("--size-mm", help="element size; default: some 10,000 elements a link")
    ] = None,
    close_mm: Annotated[
        float | None,
        typer.Option("--close-mm", help="width of openings to close; default: by trial"),
    ] = None,
    material: Annotated[
        str | None, typer.Option("--material", help="steel (default), aluminium or cast-iron; one link has its model's")
    ] = None,
    youngs_modulus: Annotated[
        float | None, typer.Option("--youngs-modulus-GPa", help="instead of the usual one")
    ] = None,
    poissons_ratio: Annotated[float | None, typer.Option("--poissons-ratio", help="instead of the usual one")] = None,
    density: Annotated[float | None, typer.Option("--density", help="kg/m^3, instead of the usual one")] = None,
    tip: Annotated[str | None, typer.Option("--tip", help="URDF link at the arm's end")] = None,
    base: Annotated[str | None, typer.Option("--base", help="URDF link at the arm's foot")] = None,
    meshes: Annotated[str, typer.Option("--meshes", help="visual or collision")] = "visual",
    rigid: Annotated[str | None, typer.Option("--rigid", help="links to leave rigid, as in hand,link_4")] = None,
    radius: Annotated[
        str | None, typer.Option("--radius", help="radius of the interface discs by link in mm, as in forearm=80")
    ] = None,
    repair: Annotated[str, typer.Option("--repair", help="auto, none (only clean surfaces) or wrap (always)")] = "auto",
    wrap: Annotated[str, typer.Option("--wrap", help="auto, grid or alpha (the extra `wrap`)")] = "auto",
    model: Annotated[str | None, typer.Option("--model", help="for one link: the model it belongs to")] = None,
    link: Annotated[str | None, typer.Option("--link", help="for one link: its name in the model")] = None,
    scale: Annotated[
        float | None, typer.Option("--scale", help="for one link: metres for a unit of the file; 0.001 for mm")
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Make shell links of surface files: a URDF with its meshes becomes a model, or one file a link of a model."""
    with user_errors(debug):
        from stiffarm.commands.importing import results as import_results
        from stiffarm.commands.importing import step as importing

        suffix = source.suffix.lower()
        if suffix not in (".urdf", *SUFFIXES):
            raise InputError("SOURCE", value=str(source), allowed=f".urdf, {', '.join(SUFFIXES)}")
        if not source.is_file():
            raise InputError("SOURCE", value=str(source), allowed="an existing file", remedy="check the path")
        _check_choices({"--repair": repair, "--wrap": wrap, "--meshes": meshes})
        lengths = {"--wall-mm": wall_mm, "--size-mm": size_mm, "--close-mm": close_mm, "--scale": scale}
        for option, value in lengths.items():
            if value is not None and not 0.0 < value < np.inf:
                raise InputError(option, value=value, allowed="greater than 0")
        options = importing.ImportOptions(
            material=material or "steel",
            figures=importing.material_of(material or "steel", youngs_modulus, poissons_ratio, density),
            wall=1e-3 * (6.0 if wall_mm is None else wall_mm),
            walls=_by_link(wall, "--wall"),
            rigid=tuple(part.strip() for part in rigid.split(",")) if rigid else (),
            radius=_by_link(radius, "--radius"),
            size=_metres(size_mm),
            opening=_metres(close_mm),
            meshes="collision" if meshes == "collision" else "visual",
            repair="none" if repair == "none" else "wrap" if repair == "wrap" else "auto",
            wrap="grid" if wrap == "grid" else "alpha" if wrap == "alpha" else "auto",
        )
        if suffix == ".urdf":
            _refuse({"--model": model, "--link": link, "--scale": scale}, "a URDF names its links and scales itself")
            urdf = read_urdf(source, tip=tip, base=base)
            with output_folder(out, {"source": source}) as folder:
                with progress("links") as bar, folder.timed("links"):
                    result = importing.import_robot(urdf, options, bar)
                content = import_results.write_robot(result, options, folder)
            import_results.show(result, content)
        else:
            robot_only: dict[str, Any] = {"--tip": tip, "--base": base, "--rigid": rigid, "--wall": wall}
            robot_only |= {"--radius": radius, "--material": material, "--youngs-modulus-GPa": youngs_modulus}
            robot_only |= {"--poissons-ratio": poissons_ratio, "--density": density}
            _refuse(robot_only, "the file is one link of a model, which has the link's material")
            if model is None or link is None:
                raise InputError(
                    f"{source.name} is one link",
                    remedy="say which, with --model MODEL --link NAME; `stiffarm robots MODEL` shows a model",
                )
            given = load_description(model)
            with output_folder(out, {"source": source, "model": content_hash(given)}) as folder:
                done = importing.import_into_model(source, given, link, options, scale, _metres(wall_mm))
                content = import_results.write_link(done, given, source.name, folder)
            for line in (*done.shell.report, *(w for w in content["warnings"] if w not in done.shell.report)):
                say(line)
        say(f"written: {out / 'model.toml'}, {out / 'import.json'}, {out / 'import.png'}")
        if as_json:
            emit_json(content)


def _metres(value_mm: float | None) -> float | None:
    return None if value_mm is None else 1e-3 * value_mm


def _check_choices(given: dict[str, str]) -> None:
    allowed = {
        "--repair": ("auto", "none", "wrap"),
        "--wrap": ("auto", "grid", "alpha"),
        "--meshes": ("visual", "collision"),
    }
    for option, value in given.items():
        if value not in allowed[option]:
            raise InputError(option, value=value, allowed=", ".join(allowed[option]), remedy="choose one of them")


def _by_link(text: str | None, option: str) -> dict[str, float]:
    """Lengths in m from ``name=mm,name=mm``; the names are checked against the robot's later."""
    if text is None:
        return {}
    names = tuple(item.partition("=")[0].strip() for item in text.split(","))
    values = parse_pairs(text, option, names)
    for name, value in values.items():
        if not value > 0.0:
            raise InputError(f"{option}: {name} (mm)", value=value, allowed="greater than 0")
    return {name: 1e-3 * value for name, value in values.items()}


def _refuse(options: dict[str, Any], why: str) -> None:
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise InputError(f"{', '.join(given)}: not for this SOURCE", remedy=f"leave it out: {why}")
