"""Commands of the surrogate: `fit`, `query`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from robots import InputError
from stiffarm import inputs, learning, payloads, steps, tables
from stiffarm.console import emit_json, say, user_errors
from stiffarm.options import (
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
from stiffarm.pose_tables import query_poses


def fit(
    model: ModelArg,
    out: Annotated[Path, typer.Option("--out", help="folder for the surrogate")],
    basis: Annotated[str, typer.Option(help="best, polynomial or trigonometric")] = "best",
    degree: Annotated[int, typer.Option(help="total degree of the polynomial", min=1, max=12)] = 6,
    order: Annotated[int, typer.Option(help="order of the trigonometric basis in each angle", min=1, max=4)] = 2,
    runs: Annotated[int, typer.Option(help="model runs to fit on", min=1, max=1_000_000)] = 4096,
    over: Annotated[str | None, typer.Option("--inputs", help="joint coordinates, as in q2_deg,q3real_deg")] = None,
    fixed: Annotated[
        str | None, typer.Option(help="where the other coordinates stand, as in q5_deg=30; default: 0")
    ] = None,
    direction: Annotated[str, typer.Option(help="load direction in base axes")] = "0,0,-1",
    links: Links = None,
    load_path: LoadPathOpt = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Learn a surrogate from joint angles to structural stiffness, judged on runs it has not seen."""
    with user_errors(debug):
        from surrogate import save_surrogate

        if basis not in ("best", "polynomial", "trigonometric"):
            raise InputError(
                "--basis", value=basis, allowed="best, polynomial, trigonometric", remedy="choose one of them"
            )
        given = inputs.read_model(model, links, load_path, without="the surrogate")
        names = inputs.parse_names(over, given.robot.coordinates, "--inputs") or steps.default_inputs(given.model)
        others = inputs.fixed_coordinates(given.robot, names, fixed)
        along = inputs.parse_direction(direction)
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
                fixed_deg=others,
                direction=along,
            )
            save_surrogate(trained.best, folder.path("surrogate.json"))
            content = payloads.trained(trained)
            folder.write_json("surrogate_errors.json", content)
        if as_json:
            emit_json(content)
        else:
            tables.surrogates(content)
            say(f"written: {out / 'surrogate.json'} ({content['best']})")


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
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Structural stiffness at poses, from a surrogate, with its error."""
    with user_errors(debug):
        from surrogate import load_surrogate
        from surrogate import query as ask

        learned = load_surrogate(surrogate_file)
        degrees, labels, remarks = query_poses(learned, pose, table)
        say_notes(tuple(remarks))
        answer = ask(learned, np.radians(degrees), extrapolate=extrapolate)
        rows = payloads.query_rows(learned, degrees, labels, answer)
        content = {
            "robot": learned.robot,
            "load_direction": list(learned.load_direction),
            "fixed_deg": dict(learned.fixed_deg),
            "errors": payloads.surrogate_errors(learned),
            "answers": rows,
        }
        if out is not None:
            import pandas as pd

            files = {"surrogate": surrogate_file} | ({} if table is None else {"poses": table})
            with output_folder(out, dict(files)) as folder:
                folder.write_json("query.json", content)
                folder.write_text("query.csv", pd.DataFrame(rows).to_csv(index=False))
        if as_json:
            emit_json(content)
        else:
            tables.answers(learned.robot, learned.inputs, rows)
