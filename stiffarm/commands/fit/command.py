"""Commands of the surrogate: `fit`, `query`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
import typer

from robots import InputError
from robots.arrays import Array
from robots.files.csv_text import records_text
from stiffarm.session import inputs, steps
from stiffarm.session.console import emit_json, progress, say, user_errors
from stiffarm.session.options import (
    Debug,
    Json,
    Links,
    LoadPathOpt,
    ModelArg,
    Out,
    Seed,
    model_hash,
    output_folder,
    say_notes,
)
from surrogate import Surrogate
from surrogate.model import COMPLIANCE


def fit(
    model: ModelArg,
    out: Annotated[Path, typer.Option("--out", help="folder for the surrogate")],
    basis: Annotated[str, typer.Option(help="best, polynomial, trigonometric, factored or adaptive")] = "best",
    degree: Annotated[int, typer.Option(help="total degree of the polynomial", min=1, max=12)] = 6,
    order: Annotated[int, typer.Option(help="order of the trigonometric basis in each angle", min=1, max=4)] = 2,
    runs: Annotated[
        int | None,
        typer.Option(help="model runs to fit on; default: 4096, or three for each term", min=1, max=1_000_000),
    ] = None,
    over: Annotated[str | None, typer.Option("--inputs", help="joint coordinates, as in q2_deg,q3real_deg")] = None,
    fixed: Annotated[
        list[str] | None,
        typer.Option(help="where the other coordinates stand, as in q5_deg=30; default: 0; may be repeated"),
    ] = None,
    direction: Annotated[str | None, typer.Option(help="load direction in base axes; default: 0,0,-1")] = None,
    quantity: Annotated[
        str, typer.Option(help="stiffness (with it the 6 x 6 compliance), or an index: k_fs, weakest, isotropy, ...")
    ] = "stiffness",
    normal: Annotated[
        str | None, typer.Option("--normal", metavar="X,Y,Z", help="surface normal in base axes, for an index")
    ] = None,
    force: Annotated[
        str | None, typer.Option("--force", metavar="X,Y,Z", help="N on the tool, base axes, for an index")
    ] = None,
    accuracy: Annotated[
        float | None,
        typer.Option(help="relative RMS error to refine to, as in 0.001: runs are added where the error is largest"),
    ] = None,
    solver: Annotated[str, typer.Option(help="qr, or ridge with its penalty by cross-validation")] = "qr",
    formats: Annotated[
        str | None, typer.Option("--format", help="also write onnx, c, python (one or more, by commas)")
    ] = None,
    matrix: Annotated[
        bool, typer.Option("--matrix", help="with --format: the 6 x 6 compliance, not the one along the load")
    ] = False,
    against: Annotated[
        bool, typer.Option("--compare", help="also fit what else one would take, on the same runs, and compare")
    ] = False,
    links: Links = None,
    load_path: LoadPathOpt = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Learn a surrogate from joint angles to structural stiffness, judged on runs it has not seen."""
    with user_errors(debug):
        from stiffarm.commands.fit import learning
        from stiffarm.commands.fit import portable as portable_files
        from stiffarm.commands.fit import report as surrogate_report
        from stiffarm.session import payloads, tables
        from surrogate import save_surrogate
        from surrogate.least_squares import SOLVERS
        from surrogate.training import BasisChoice

        _choose("--basis", basis, get_args(BasisChoice))
        _choose("--solver", solver, SOLVERS)
        if quantity not in learning.quantities():
            _choose("--quantity", quantity, learning.quantities())
        if accuracy is not None and not 0.0 < accuracy < 1.0:
            raise InputError(
                "--accuracy", value=accuracy, allowed="above 0, below 1", remedy="0.001 is a tenth of a percent"
            )
        asked = portable_files.parse_formats(formats)
        if matrix and basis not in ("best", "factored"):
            raise InputError("--matrix with --basis", value=basis, allowed="factored, best", remedy="leave one out")
        _refuse_conflicts(quantity, basis, matrix, asked, {"normal": normal, "force": force, "direction": direction})
        along = inputs.parse_direction(direction or "0,0,-1")
        vectors = {
            name: None if text is None else np.array(inputs.parse_direction(text, f"--{name}"))
            for name, text in (("normal", normal), ("force", force))
        }
        given = inputs.read_model(model, links, load_path, without="the surrogate")
        if note := inputs.no_springs_note(given):
            say(f"note: {note}")
        names = inputs.parse_names(over, given.robot.coordinates, "--inputs") or steps.default_inputs(given.model)
        others = inputs.fixed_coordinates(given.robot, names, ",".join(fixed) if fixed else None)
        scalar = None
        if quantity != learning.STIFFNESS:
            scalar = learning.index_quantity(given.model, quantity, vectors["normal"], vectors["force"])
        with output_folder(out, {"model": model_hash(given)}, seed) as folder:
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
                accuracy=accuracy,
                solver=solver,
                fixed_deg=others,
                direction=along,
                scalar=scalar,
            )
            save_surrogate(trained.best, folder.path("surrogate.json"))
            content = payloads.trained(trained)
            content["files"] = ["surrogate.json", *portable_files.write(trained, asked, folder, matrix=matrix)]
            if against:
                from stiffarm.commands.fit import comparison as surrogate_comparison

                with progress("other methods") as bar:
                    content["comparison"] = surrogate_comparison.compare(trained, bar)
                folder.write_text("surrogate_comparison.csv", surrogate_comparison.table(content["comparison"]))
                content["files"].append("surrogate_comparison.csv")
            with folder.timed("report"):
                title = given.description.title.split(" (")[0]
                content["files"] += surrogate_report.write_report(trained, content, folder, title=title, model=model)
            folder.write_json("surrogate_errors.json", content)
        if as_json:
            emit_json(content)
            return
        tables.surrogates(content)
        if against:
            tables.peers(content["comparison"])
        say(f"written: {', '.join(str(out / name) for name in content['files'])} ({content['best']})")


def _choose(option: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise InputError(option, value=value, allowed=", ".join(allowed), remedy="choose one of them")


def _refuse_conflicts(
    quantity: str, basis: str, matrix: bool, formats: tuple[str, ...], vectors: dict[str, str | None]
) -> None:
    """Refuse options that would do nothing, or fail once the fit is done."""
    stiffness = quantity == "stiffness"
    for name, text in vectors.items():
        if text is not None and stiffness == (name != "direction"):
            what = "of the stiffness" if stiffness else f"of {quantity}, which has no load direction of its own"
            raise InputError(f"--{name} for a surrogate {what}", value=text, allowed="nothing", remedy="leave it out")
    if matrix and not formats:
        raise InputError("--matrix without --format", allowed="onnx, c, python", remedy="add --format onnx")
    if matrix and not stiffness:
        raise InputError("--matrix with --quantity", value=quantity, allowed="stiffness", remedy="leave one out")
    if basis == "factored" and not stiffness:
        raise InputError(
            "--basis factored with --quantity", value=quantity, allowed="stiffness", remedy="take adaptive or best"
        )


def query(
    surrogate_file: Annotated[Path, typer.Argument(metavar="SURROGATE", help="surrogate.json")],
    table: Annotated[
        Path | None, typer.Argument(metavar="[POSES]", help="table with joint columns, CSV or XLSX")
    ] = None,
    pose: Annotated[
        list[str] | None, typer.Option("--pose", help="as in q2_deg=5,q3real_deg=77.5; may be repeated")
    ] = None,
    extrapolate: Annotated[
        bool, typer.Option("--extrapolate", help="answer outside the fitted domain too, flagged")
    ] = False,
    direction: Annotated[
        str | None, typer.Option("--direction", help="another load direction, base axes; needs the basis factored")
    ] = None,
    matrix: Annotated[
        bool, typer.Option("--matrix", help="with the 6 x 6 compliance in SI units; needs the basis factored")
    ] = False,
    of: Annotated[
        str | None, typer.Option("--model", metavar="MODEL", help="refuse a surrogate of another robot or model")
    ] = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Structural stiffness at poses, from a surrogate, with its error bar and flags."""
    with user_errors(debug):
        from stiffarm.commands.query import answers
        from stiffarm.session import payloads
        from stiffarm.session.pose_tables import query_poses
        from surrogate import load_surrogate
        from surrogate import query as ask

        learned = load_surrogate(surrogate_file)
        if of is not None:
            inputs.require_same_model(learned, of, surrogate_file)
        along = None if direction is None else np.array(inputs.parse_direction(direction))
        degrees, labels, remarks = query_poses(learned, pose, table)
        say_notes(tuple(remarks))
        result = ask(learned, np.radians(degrees), extrapolate=extrapolate, direction=along)
        rows = answers.query_rows(learned, degrees, labels, result, matrix=matrix)
        content: dict[str, Any] = {
            "robot": learned.robot,
            "quantity": learned.quantity.name,
            "quantity_in_words": learned.quantity.label,
            "load_direction": _load_direction(learned, along),
            "fixed_deg": dict(learned.fixed_deg),
            "errors": payloads.surrogate_errors(learned),
            "answers": rows,
        }
        if out is not None:
            files = {"surrogate": surrogate_file} | ({} if table is None else {"poses": table})
            with output_folder(out, dict(files)) as folder:
                folder.write_json("query.json", content)
                folder.write_text("query.csv", records_text(rows))
        unanswered = int(np.count_nonzero(~result.answered))
        if unanswered:
            say(f"note: {unanswered} of {len(rows)} poses are outside of what was fitted and have no value: see flags")
        if as_json:
            emit_json(content)
        else:
            answers.show_answers(learned, rows)


def _load_direction(learned: Surrogate, along: Array | None) -> list[float] | None:
    """The load direction of the answers; an index has none."""
    if learned.quantity.name != COMPLIANCE:
        return None
    return list(learned.load_direction) if along is None else [float(v) for v in along]
