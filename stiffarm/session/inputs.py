"""From what a user types to arrays: models, poses, loads, joint lists."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from doe import Measurements, bundled_data, read_measurements
from doe.estimation.campaign import Campaign, bundled_campaign, load_campaign
from fem import FLANGES, LINK_KINDS, LinkKind
from fem.arm import Arm, with_flanges
from fem.effects import LOAD_PATH, Maker
from fem.effects import with_load_path as described_with_load_path
from robots import InputError, InputErrors, LoadPath, ModelDescription, Robot, content_hash, load_description
from robots.arrays import Array
from stiffarm.session.console import progress, say
from stiffarm.session.softness import refuse_too_soft
from surrogate import Surrogate, default_sweep, load_surrogate

WRENCH_NAMES = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
# Far above any load; beyond about 1e150 squares overflow.
LARGEST_LOAD = 1e9


# What commands and steps call an arm that was asked for.
ModelInput = Arm


def read_model(
    name: str, links: str | None, load_path: str | None, *, own: tuple[Maker, ...] = (), without: str | None = None
) -> ModelInput:
    """Load and build a model; links default to what it was calibrated with, else beams.

    ``shell:distributing`` and ``shell:rigid`` choose how the flanges of all shell links are coupled; the choice goes
    into the description, so that a calibrated model keeps it. ``without``: what the command makes from the linear arm
    alone ("the map"): effects that this leaves out are named. A model so soft that none of its results would hold is
    refused.
    """
    description = load_description(name)
    asked, _, flanges = (links or "").partition(":")
    if links is None:
        asked = description.calibration.links if description.calibration else "beam"
    if asked not in LINK_KINDS or (flanges and (asked != "shell" or flanges not in FLANGES)):
        allowed = [*LINK_KINDS, *(f"shell:{choice}" for choice in FLANGES)]
        raise InputError("--links", value=links, allowed=", ".join(allowed), remedy="choose one of them")
    kind: LinkKind = next(known for known in LINK_KINDS if known == asked)
    if flanges:
        description = with_flanges(description, "distributing" if flanges == "distributing" else "rigid")
    path: LoadPath | None = None
    if load_path is not None:
        path = as_load_path(load_path)
        if any(table.code == LOAD_PATH for table in description.effect):
            description = described_with_load_path(description, path)
    with _announced(kind, description):
        arm = Arm.of(description, kind, path, own)
    refuse_too_soft(description, arm.model)
    if arm.effects and without is not None:
        say(f"note: not in {without}: {', '.join(e.effect.code for e in arm.effects)}")
    return arm


def as_load_path(text: str) -> LoadPath:
    """A load path by its name."""
    if text not in ("parallelogram", "serial"):
        raise InputError("--load-path", value=text, allowed="parallelogram, serial")
    return "parallelogram" if text == "parallelogram" else "serial"


def no_springs_note(arm: Arm) -> str | None:
    """What to know of a model none of whose joints gives way; None where some do."""
    if len(arm.joints_without_springs) < len(arm.model.joints):
        return None
    return (
        f"no joint of {arm.robot.name} has a stiffness in this model, so only its links give way: some ten times too "
        "stiff as a rule; `stiffarm calibrate` finds the joints' from readings"
    )


def refuse_effects(given: ModelInput, what: str, remedy: str) -> None:
    """Refuse a model with effects where their part in the springs would be counted twice."""
    if given.description.effect:
        codes = ", ".join(table.code for table in given.description.effect)
        raise InputError(f"{what} of a model with effects", value=codes, allowed="no [[effect]]", remedy=remedy)


@contextmanager
def _announced(links: LinkKind, description: ModelDescription) -> Iterator[None]:
    """Shells take a while to build, so they are announced."""
    if links != "shell":
        yield
        return
    say(f"building shell models of {len(description.link)} links")
    with progress("shell models of links"):
        yield


def with_load_path(given: Arm, load_path: LoadPath) -> Arm:
    """The same arm with another load path; said where that takes a while."""
    with _announced(
        "beam" if load_path in ("serial", given.model.load_path) else given.model.link_kind, given.description
    ):
        return given.with_load_path(load_path)


def with_links(given: Arm, links: LinkKind) -> Arm:
    """The same arm with another kind of links; said where that takes a while."""
    with _announced(links, given.description):
        return given.with_links(links)


def read_data(robot: Robot, name: str, file: Path | None) -> Measurements:
    """The measurement table given, or the one bundled with the robot.

    Raises
    ------
    InputError
        No file given and none bundled, or a table that does not fit the robot.
    """
    if file is not None:
        return read_measurements(file, robot)
    try:
        bundled = bundled_data(robot.name)
    except InputError as error:
        raise InputError(
            f"no measurements are bundled for {robot.name}",
            remedy="give a measurement table (DATA), CSV or XLSX",
        ) from error
    return read_measurements(bundled, robot)


def read_scheme(robot: Robot, file: Path | None) -> Campaign:
    """The scheme given, or the one bundled with the robot.

    Raises
    ------
    InputError
        No file given and none bundled, or a scheme of another robot.
    """
    if file is not None:
        if not file.is_file():
            raise InputError("scheme file", value=str(file), allowed="an existing scheme TOML", remedy="check the path")
        scheme = load_campaign(file)
        scheme.check_against(robot)
        if scheme.robot != robot.name:
            raise InputError(
                f"scheme file {file} is for robot",
                value=scheme.robot,
                allowed=robot.name,
                remedy="choose the scheme of this robot, or name this robot in its 'robot' key",
            )
        return scheme
    scheme_or_none = bundled_campaign(robot.name)
    if scheme_or_none is None:
        raise InputError(
            f"no calibration scheme is bundled for {robot.name}",
            remedy="give a scheme TOML with --scheme-file, or use --scheme global",
        )
    return scheme_or_none


def parse_pairs(text: str, option: str, allowed: tuple[str, ...]) -> dict[str, float]:
    """Read ``name=value,name=value`` with known names and finite numbers; all faults at once."""
    out: dict[str, float] = {}
    faults = []
    for item in text.split(","):
        name, _, number = (part.strip() for part in item.partition("="))
        if name not in allowed:
            faults.append(
                InputError(
                    f"{option}: name",
                    value=name,
                    allowed=", ".join(allowed),
                    remedy=f"write name=value pairs separated by commas, as in {allowed[0]}=5",
                )
            )
            continue
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            faults.append(
                InputError(
                    f"{option}: {name}",
                    value=number,
                    allowed="a finite number",
                    remedy=f"write it with a decimal point and without a unit, as in {name}=5",
                )
            )
        elif name in out:
            faults.append(InputError(f"{option}: {name} is given twice", allowed="each name once", remedy="remove one"))
        else:
            out[name] = value
    if faults:
        raise faults[0] if len(faults) == 1 else InputErrors(option, faults)
    return out


def parse_pose(robot: Robot, text: str) -> Array:
    """One pose (dof,) rad from ``q2_deg=5,q3real_deg=77.5``; the rest is 0. Limits are checked."""
    values = parse_pairs(text, "--pose", robot.coordinates)
    q = np.radians([values.get(name, 0.0) for name in robot.coordinates])
    wrong = robot.violations(q)
    if wrong:
        raise InputError(
            f"--pose {text}: {robot.name} cannot take it: {'; '.join(wrong)}",
            remedy="keep the ranges named (a coordinate that is not given stands at 0)",
        )
    return np.asarray(q)


def parse_load(text: str, option: str = "--load") -> Array:
    """A wrench (6,) from ``fz_N=-650,mx_Nm=10``."""
    values = parse_pairs(text, option, WRENCH_NAMES)
    wrench = np.array([values.get(name, 0.0) for name in WRENCH_NAMES])
    if not 0.0 < np.abs(wrench).max() <= LARGEST_LOAD:
        raise InputError(
            option,
            value=text,
            allowed=f"a force or moment that is not zero, up to {LARGEST_LOAD:g} N or N m",
            remedy="give the load in N and N m, as in fz_N=-650",
        )
    return wrench


def parse_names(text: str | None, allowed: tuple[str, ...], option: str) -> tuple[str, ...] | None:
    """A comma-separated list of known names, or None."""
    if text is None:
        return None
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    for name in names:
        if name not in allowed:
            raise InputError(
                option, value=name, allowed=", ".join(allowed), remedy="choose from these, separated by commas"
            )
    if not names or len(set(names)) != len(names):
        raise InputError(
            option,
            value=text,
            allowed=", ".join(allowed),
            remedy="name at least one, each once, separated by commas",
        )
    return names


def parse_loads(text: str | None) -> tuple[float, ...] | None:
    """``--loads 150,650`` or ``--loads all`` (an empty tuple), or None if not given."""
    if text is None:
        return None
    if text.strip() == "all":
        return ()
    loads = _numbers(text)
    if loads is None or not all(0.0 < v <= LARGEST_LOAD for v in loads):
        raise InputError(
            "--loads",
            value=text,
            allowed="'all', or force magnitudes greater than 0 N",
            remedy="separate them by commas, as in 150,650",
        )
    return loads


def parse_direction(text: str, option: str = "--direction") -> tuple[float, float, float]:
    """A direction in base axes from ``0,0,-1``; its length does not matter."""
    values = _numbers(text)
    if values is None or len(values) != 3 or not any(values):
        raise InputError(
            option,
            value=text,
            allowed="three finite numbers x,y,z, not all zero",
            remedy="separate them by commas, as in 0,0,-1",
        )
    largest = max(map(abs, values))  # so that no square overflows later
    x, y, z = (v / largest for v in values)
    return x, y, z


def parse_layers(robot: Robot, text: str | None) -> tuple[float, ...] | None:
    """Values in deg, ``-90,0,90``, of the coordinate that leaves a map's plane; None if not given."""
    if text is None:
        return None
    name = default_sweep(robot)[1]
    if name is None:
        raise InputError(
            "--layers", value=text, allowed=f"nothing: the map of {robot.name} has no layers", remedy="leave it out"
        )
    low, high = np.degrees(robot.limits[robot.coordinate_index(name)])
    values = _numbers(text)
    if values is None or not all(low <= v <= high for v in values) or len(set(values)) < len(values):
        raise InputError(
            "--layers",
            value=text,
            allowed=f"values of {name}, each once, from {low:g} to {high:g} deg",
            remedy="separate them by commas, as in -90,0,90",
        )
    return values


def _numbers(text: str) -> tuple[float, ...] | None:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        return None
    return values if all(map(math.isfinite, values)) else None


def fixed_coordinates(robot: Robot, names: tuple[str, ...], text: str | None) -> dict[str, float]:
    """Where the coordinates that are no input of a surrogate stand: ``q5_deg=0``; deg, 0 if not given."""
    others = tuple(n for n in robot.coordinates if n not in names)
    if text is not None and not others:
        raise InputError("--fixed", value=text, allowed="nothing: every coordinate is one of --inputs")
    given = {} if text is None else parse_pairs(text, "--fixed", others)
    fixed = {name: given.get(name, 0.0) for name in others}
    for name, value in fixed.items():
        low, high = np.degrees(robot.limits[robot.coordinate_index(name)])
        if not low <= value <= high:
            raise InputError(
                f"--fixed: {name}" + ("" if name in given else ", which is not given and taken as 0"),
                value=value,
                allowed=f"{low:g} to {high:g} deg",
                remedy=f"give --fixed {name}=..., or make it one of --inputs",
            )
    return fixed


def require_same_model(learned: Surrogate, name: str, file: Path) -> None:
    """Refuse a surrogate that was fitted to another robot, or to another model of it, than ``name``.

    Raises
    ------
    InputError
        It was.
    """
    description = load_description(name)
    refit = "fit one for it (`stiffarm fit`)"
    if learned.robot != description.name:
        raise InputError(f"surrogate {file} is of robot", value=learned.robot, allowed=description.name, remedy=refit)
    own = content_hash(description)
    if learned.model_hash != own:
        raise InputError(
            f"surrogate {file} was fitted to a model with hash",
            value=learned.model_hash[:12],
            allowed=own[:12],
            remedy=refit,
        )


def read_surrogate_for_map(given: ModelInput, file: Path) -> Surrogate:
    """A surrogate that can stand for this robot in the 3-D map.

    Raises
    ------
    InputError
        Another robot's, of another load than the vertical one, or without a coordinate that the map moves.
    """
    learned = load_surrogate(file)
    refit = "fit one for this map (`stiffarm fit`)"
    if learned.robot != given.robot.name:
        raise InputError(f"surrogate {file} is of robot", value=learned.robot, allowed=given.robot.name, remedy=refit)
    if not np.allclose(learned.load_direction, (0.0, 0.0, -1.0), rtol=0.0, atol=1e-9):
        raise InputError(
            f"surrogate {file}: load direction", value=learned.load_direction, allowed="0, 0, -1", remedy=refit
        )
    swept, layer = default_sweep(given.robot)
    held = [name for name in (*swept, layer) if name is not None and name not in learned.inputs]
    if held:
        raise InputError(
            f"surrogate {file} knows only one value of {', '.join(held)}, which the map moves", remedy=refit
        )
    return learned


def parse_parameters(text: str | None) -> tuple[str, ...] | None:
    """Names of parameters separated by commas; the model knows which there are."""
    if text is None:
        return None
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    if not names or len(set(names)) < len(names):
        raise InputError(
            "--free",
            value=text,
            allowed="names of parameters, each once, separated by commas",
            remedy="as in --free j2.stiffness,j3.stiffness",
        )
    return names
