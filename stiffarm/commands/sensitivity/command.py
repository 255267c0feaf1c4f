"""The command `sensitivity`: the published factorial, or a screening of any numbers of the model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from doe import Measurements, sensitivity_study
from doe.estimation.campaign import Campaign, bundled_campaign, load_campaign
from doe.estimation.study_plan import Comparison
from doe.tables.loaded import select_poses
from fem.arm import Arm
from robots import InputError
from stiffarm.commands.sensitivity import factorial
from stiffarm.commands.sensitivity import screening as screenings
from stiffarm.commands.sensitivity.screening import Method, Study
from stiffarm.session import parsing, steps
from stiffarm.session.console import say, show_table
from stiffarm.session.frame import command
from stiffarm.session.options import (
    ConfirmUnits,
    DataArg,
    Debug,
    Joints,
    Json,
    Links,
    LoadPathOpt,
    ModelArg,
    Out,
    Seed,
    Sets,
)
from stiffarm.session.outputs import OutputFolder

_METHODS: tuple[Method, ...] = ("morris", "sobol", "derivative")
_SAMPLES, _TRAJECTORIES = 512, 40


def sensitivity(
    model: ModelArg,
    data: DataArg = None,
    poses: Annotated[
        str | None,
        typer.Option(
            "--poses",
            help="Pose labels, separated by commas, as in 5,41,77. Default: those of the scheme, otherwise all.",
        ),
    ] = None,
    joints: Joints = None,
    method: Annotated[
        str | None,
        typer.Option(
            "--method", help="Method: factorial (the published one), morris, sobol or derivative. Default: factorial."
        ),
    ] = None,
    free: Annotated[
        str | None,
        typer.Option(
            "--free", help="Parameters to vary, separated by commas, as in j2.stiffness,base.ry,forearm.modulus."
        ),
    ] = None,
    campaign: Annotated[
        Path | None, typer.Option("--campaign", help="Campaign file (TOML) whose parameters and ranges are varied.")
    ] = None,
    component: Annotated[
        str | None,
        typer.Option(
            "--component",
            help="Tool displacement component: x, y, z, rx, ry or rz. Default: the translation that was read largest.",
        ),
    ] = None,
    samples: Annotated[
        int | None,
        typer.Option(
            "--samples", help=f"Number of samples of a Sobol study, a power of two. Default: {_SAMPLES}.", max=2**20
        ),
    ] = None,
    trajectories: Annotated[
        int | None,
        typer.Option(
            "--trajectories",
            help=f"Number of trajectories of a Morris study. Default: {_TRAJECTORIES}.",
            min=2,
            max=10**5,
        ),
    ] = None,
    low: Annotated[
        float | None,
        typer.Option(
            help="Low level of the joint stiffnesses, in N m/rad. Default: the scheme's, otherwise that of arms of "
            "this size."
        ),
    ] = None,
    high: Annotated[
        float | None, typer.Option(help="High level of the joint stiffnesses, in N m/rad. Default: as for --low.")
    ] = None,
    seed: Seed = 0,
    confirm_units: ConfirmUnits = False,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Show which parameters matter at which pose.

    By a factorial of the joint stiffnesses (the published method), or by Morris, Sobol or derivatives of any
    parameters.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        options = {
            "--free": free,
            "--campaign": campaign,
            "--component": component,
            "--samples": samples,
            "--trajectories": trajectories,
        }
        chosen = _method(method, joints, options)
        names = parsing.parse_names(free, None, "--free")
        given = frame.model(model, links, load_path, without="the sensitivities", sets=sets, shown=True)
        table = frame.readings(given, data, confirm_units=confirm_units)
        frame.reads(campaign=campaign)
        bundled = bundled_campaign(given.robot.name)
        scheme = None if bundled is None else bundled.compare
        springs = parsing.parse_names(joints, given.robot.joint_names, "--joints")
        springs = springs or (scheme.sensitivity.joints if scheme else steps.springs_seen(given, table))
        levels = _levels(given, springs, bundled, (low, high))
        labels = _labels(poses, table, scheme)
        with frame.folder_if(None if chosen is None else seed) as folder:
            if chosen is None:
                result, show = _factorial(given, table, springs, labels, levels, folder)
            else:
                at = select_poses(table, labels, "--poses")
                numbers = load_campaign(campaign) if campaign else names or tuple(f"{j}.stiffness" for j in springs)
                found = screenings.study(
                    given,
                    at,
                    chosen,
                    numbers,
                    levels,
                    component=component or screenings.read_most(at),
                    samples=samples or _SAMPLES,
                    trajectories=trajectories or _TRAJECTORIES,
                    seed=seed,
                )
                result, show = _screened(given, at, found, folder)
        frame.answer(result, show)


def _method(text: str | None, joints: str | None, options: dict[str, Any]) -> Method | None:
    """The study asked for; None is the factorial. Options that it would not heed are refused."""
    given = [name for name, value in options.items() if value is not None]
    if text is None and given:
        chosen: Method | None = "morris" if "--trajectories" in given else "sobol"
    else:
        word = parsing.parse_word("factorial" if text is None else text, ("factorial", *_METHODS), "--method")
        chosen = next((m for m in _METHODS if m == word), None)
    unheeded = {
        None: list(options),
        "sobol": ["--trajectories"],
        "morris": ["--samples"],
        "derivative": ["--samples", "--trajectories"],
    }[chosen]
    why_not = f"no option of --method {chosen or 'factorial'}"
    parsing.refuse_given({name: options[name] for name in unheeded}, why_not, "leave it out, or change --method")
    parsing.refuse_together({"--joints": joints, "--free": options["--free"], "--campaign": options["--campaign"]})
    return chosen


def _levels(
    given: Arm, springs: tuple[str, ...], scheme: Campaign | None, typed: tuple[float | None, float | None]
) -> tuple[float, float]:
    """Range of the stiffnesses: as typed, else the scheme's, else that of arms of this size."""
    usual = steps.usual_springs(given, springs) if scheme is None else scheme.springs.ends
    low, high = (own if own is not None else end for own, end in zip(typed, usual, strict=True))
    if not (0.0 < low < high and np.isfinite(high)):
        raise InputError(
            "--low, --high",
            code="M002",
            value=f"{low:g}, {high:g}",
            allowed="0 < low < high, finite, N m/rad",
            remedy="give the range in which the springs are expected",
        )
    return low, high


def _labels(poses: str | None, table: Measurements, scheme: Comparison | None) -> tuple[str, ...]:
    """The poses named, else those of the scheme if they were measured, else all."""
    every = tuple(dict.fromkeys(table.pose))
    labels = parsing.parse_names(poses, every, "--poses")
    if labels is not None:
        return labels
    planned = scheme.sensitivity.poses if scheme and set(scheme.sensitivity.poses) <= set(every) else ()
    return planned or every


def _factorial(
    given: Arm,
    table: Measurements,
    springs: tuple[str, ...],
    labels: tuple[str, ...],
    levels: tuple[float, float],
    folder: OutputFolder | None,
) -> tuple[dict[str, Any], Callable[[], None]]:
    effects = sensitivity_study(given.model, select_poses(table, labels, "--poses"), springs, *levels)
    result = {
        "robot": given.robot.name,
        "load_path": given.model.load_path,
        "links": given.model.link_kind,
        "low_Nm_per_rad": levels[0],
        "high_Nm_per_rad": levels[1],
        "effects": factorial.payload(effects),
    }
    if folder is not None:
        from stiffarm.commands.sensitivity.report import write_factorial_report

        folder.write_json("sensitivity.json", result)
        write_factorial_report(given, table, effects, levels, folder)
    return result, lambda: factorial.show(effects, *levels, given.model.load_path)


def _screened(
    given: Arm, table: Measurements, found: Study, folder: OutputFolder | None
) -> tuple[dict[str, Any], Callable[[], None]]:
    head = {"robot": given.robot.name, "load_path": given.model.load_path, "links": given.model.link_kind}
    result = head | screenings.payload(found)
    if folder is not None:
        from stiffarm.commands.sensitivity.report import write_screening_report

        folder.write_json("sensitivity.json", result)
        write_screening_report(given, table, found, folder)

    def show() -> None:
        show_table(*screenings.table(found))
        for p in found.parameters:
            say(f"varied: {p.name}, {screenings.range_text(p)}")

    return result, show
