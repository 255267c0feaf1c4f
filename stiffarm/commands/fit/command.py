"""The command `fit`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

import numpy as np
import typer

from robots import InputError
from stiffarm.session import parsing
from stiffarm.session.caution import uncalibrated
from stiffarm.session.console import say_notes
from stiffarm.session.frame import command
from stiffarm.session.options import (
    Debug,
    Json,
    Links,
    LoadPathOpt,
    ModelArg,
    Seed,
    Sets,
)
from stiffarm.session.parsing import parse_word
from stiffarm.session.stated import AtLoad
from surrogate import inputs_that_matter


def fit(
    model: ModelArg,
    out: Annotated[Path, typer.Option("--out", help="Folder for the surrogate; it is created if needed.")],
    basis: Annotated[
        str,
        typer.Option(
            help="Basis: polynomial, trigonometric, factored, adaptive, or best (the most accurate of these)."
        ),
    ] = "best",
    degree: Annotated[int, typer.Option(help="Total degree of the polynomial basis.", min=1, max=12)] = 6,
    order: Annotated[int, typer.Option(help="Order of the trigonometric basis in each angle.", min=1, max=4)] = 2,
    runs: Annotated[
        int | None,
        typer.Option(
            help="Number of model runs to fit to. Default: 4096, or three per term if that is more.",
            min=1,
            max=1_000_000,
        ),
    ] = None,
    over: Annotated[
        str | None,
        typer.Option(
            "--inputs",
            help="Joint coordinates that the surrogate covers, separated by commas, as in q2_deg,q3real_deg. "
            "Default: all that matter.",
        ),
    ] = None,
    fixed: Annotated[
        list[str] | None,
        typer.Option(
            help="Values of the other joint coordinates in deg, as in q5_deg=30. May be repeated. Default: 0."
        ),
    ] = None,
    direction: Annotated[str | None, typer.Option(help="Load direction in base axes. Default: 0,0,-1.")] = None,
    quantity: Annotated[
        str,
        typer.Option(
            help="Quantity to learn: stiffness (with the 6 x 6 compliance), or an index such as k_fs, weakest "
            "or isotropy."
        ),
    ] = "stiffness",
    normal: Annotated[
        str | None,
        typer.Option("--normal", metavar="X,Y,Z", help="Surface normal in base axes, for an index that needs one."),
    ] = None,
    force: Annotated[
        str | None,
        typer.Option(
            "--force", metavar="X,Y,Z", help="Force on the tool in base axes, in N, for an index that needs one."
        ),
    ] = None,
    formats: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="Also write the surrogate in these formats, separated by commas: onnx, c, python, javascript.",
        ),
    ] = None,
    matrix: Annotated[
        bool,
        typer.Option(
            "--matrix", help="With --format: write the 6 x 6 compliance instead of the compliance along the load."
        ),
    ] = False,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Fit a surrogate of the stiffness over the joint angles.

    Its errors are measured on model runs that it has not seen. Writes surrogate.json, its errors and a report into
    --out.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        from stiffarm.commands.fit import learning, results
        from stiffarm.commands.fit import portable as portable_files
        from stiffarm.commands.fit import report as surrogate_report
        from surrogate import save_surrogate
        from surrogate.training import BasisChoice

        parse_word(basis, get_args(BasisChoice), "--basis")
        parse_word(quantity, learning.quantities(), "--quantity")
        asked = portable_files.parse_formats(formats)
        if matrix and basis not in ("best", "factored"):
            raise InputError(
                "--matrix with --basis", code="A002", value=basis, allowed="factored, best", remedy="leave one out"
            )
        _refuse_conflicts(quantity, basis, matrix, asked, {"normal": normal, "force": force, "direction": direction})
        along = parsing.parse_direction(direction or "0,0,-1")
        vectors = {
            name: None if text is None else np.array(parsing.parse_direction(text, f"--{name}"))
            for name, text in (("normal", normal), ("force", force))
        }
        given = frame.model(model, links, load_path, sets=sets, shown=True)
        if note := uncalibrated(given):
            say_notes([note])
        given = frame.at_load(given, at_load, vectors["force"] if vectors["force"] is not None else along)
        names = parsing.parse_names(over, given.robot.coordinates, "--inputs") or inputs_that_matter(given.model, along)
        others = parsing.fixed_coordinates(given.robot, names, ",".join(fixed) if fixed else None)
        scalar = None
        if quantity != learning.STIFFNESS:
            scalar = learning.index_quantity(given.model, quantity, vectors["normal"], vectors["force"])
        with frame.folder(seed) as folder:
            trained = learning.learn(
                given.description,
                given.model,
                names,
                seed,
                folder,
                basis=basis,
                degree=degree,
                order=order,
                runs=runs,
                fixed_deg=others,
                direction=along,
                scalar=scalar,
            )
            save_surrogate(trained.best, folder.path("surrogate.json"))
            content = results.payload(trained)
            files = ["surrogate.json", *portable_files.write(trained, asked, folder, matrix=matrix)]
            with folder.timed("report"):
                title = given.description.title.split(" (")[0]
                surrogate_report.write_report(trained, files, folder, title=title, model=model)
            content["files"] = [*files, "report.html"]
            folder.write_json("surrogate_errors.json", content)
        frame.answer(content, lambda: results.show(trained))


def _refuse_conflicts(
    quantity: str, basis: str, matrix: bool, formats: tuple[str, ...], vectors: dict[str, str | None]
) -> None:
    """Refuse options that would do nothing, or fail once the fit is done."""
    stiffness = quantity == "stiffness"
    for name, text in vectors.items():
        if text is not None and stiffness == (name != "direction"):
            what = "of the stiffness" if stiffness else f"of {quantity}, which has no load direction of its own"
            raise InputError(
                f"--{name} for a surrogate {what}", code="A002", value=text, allowed="nothing", remedy="leave it out"
            )
    if matrix and not formats:
        raise InputError(
            "--matrix without --format", code="A002", allowed="onnx, c, python, javascript", remedy="add --format onnx"
        )
    if matrix and not stiffness:
        raise InputError(
            "--matrix with --quantity", code="A002", value=quantity, allowed="stiffness", remedy="leave one out"
        )
    if basis == "factored" and not stiffness:
        raise InputError(
            "--basis factored with --quantity",
            code="A002",
            value=quantity,
            allowed="stiffness",
            remedy="take adaptive or best",
        )
