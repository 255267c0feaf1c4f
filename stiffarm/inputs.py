"""From what a user types to arrays: models, poses, loads, joint lists."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from doe import Measurements, Scheme, bundled_data, bundled_scheme, load_scheme, read_measurements
from fem import LINK_KINDS, ArmModel, LinkKind, build_model
from robots import InputError, InputErrors, LoadPath, ModelDescription, Robot, load_description
from robots.robot import robot_from

Array = NDArray[np.float64]

WRENCH_NAMES = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")


@dataclass(frozen=True)
class ModelInput:
    """A model as asked for: description, robot, mechanics."""

    description: ModelDescription
    robot: Robot
    model: ArmModel


def read_model(name: str, links: str | None, load_path: str | None) -> ModelInput:
    """Load and build a model; links default to what it was calibrated with, else beams."""
    description = load_description(name)
    kind: LinkKind = "beam"
    asked = links or (description.calibration.links if description.calibration else "beam")
    if asked not in LINK_KINDS:
        raise InputError("--links", value=asked, allowed=", ".join(LINK_KINDS))
    kind = "rigid" if asked == "rigid" else "beam"
    path: LoadPath | None = None
    if load_path is not None:
        if load_path not in ("parallelogram", "serial"):
            raise InputError("--load-path", value=load_path, allowed="parallelogram, serial")
        path = "parallelogram" if load_path == "parallelogram" else "serial"
    return ModelInput(description, robot_from(description), build_model(description, kind, path))


def with_load_path(given: ModelInput, load_path: LoadPath) -> ModelInput:
    """The same model with another load path."""
    return ModelInput(
        given.description, given.robot, build_model(given.description, given.model.link_kind, load_path)
    )


def read_data(robot: Robot, name: str, file: Path | None) -> Measurements:
    """The measurement table given, or the one bundled with the robot."""
    if file is None:
        file = Path(bundled_data(robot.name))
    return read_measurements(file, robot)


def read_scheme(robot: Robot, file: Path | None) -> Scheme:
    """The scheme given, or the one bundled with the robot.

    Raises
    ------
    InputError
        No file given and none bundled.
    """
    if file is not None:
        scheme = load_scheme(file)
        scheme.check_against(robot)
        return scheme
    scheme_or_none = bundled_scheme(robot.name)
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
            faults.append(InputError(f"{option}: name", value=name, allowed=", ".join(allowed)))
            continue
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            faults.append(
                InputError(f"{option}: {name}", value=number, allowed="a finite number, as in q2_deg=5")
            )
        elif name in out:
            faults.append(InputError(f"{option}: {name} is given twice"))
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


def parse_load(text: str) -> Array:
    """A wrench (6,) from ``fz_N=-650,mx_Nm=10``."""
    values = parse_pairs(text, "--load", WRENCH_NAMES)
    wrench = np.array([values.get(name, 0.0) for name in WRENCH_NAMES])
    if not wrench.any():
        raise InputError("--load", value=text, allowed="at least one force or moment that is not zero")
    return wrench


def parse_names(text: str | None, allowed: tuple[str, ...], option: str) -> tuple[str, ...] | None:
    """A comma-separated list of known names, or None."""
    if text is None:
        return None
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    for name in names:
        if name not in allowed:
            raise InputError(option, value=name, allowed=", ".join(allowed))
    if not names or len(set(names)) != len(names):
        raise InputError(option, value=text, allowed="names, each once, separated by commas")
    return names


def parse_loads(text: str | None) -> tuple[float, ...] | None:
    """``--loads 150,650`` or ``--loads all`` (an empty tuple), or None if not given."""
    if text is None:
        return None
    if text.strip() == "all":
        return ()
    try:
        loads = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(
            "--loads", value=text, allowed="'all' or force magnitudes in N, as in 150,650"
        ) from error
    if not all(math.isfinite(v) and v > 0.0 for v in loads):
        raise InputError("--loads", value=text, allowed="force magnitudes greater than 0 N")
    return loads


def read_pose_table(names: tuple[str, ...], file: Path) -> tuple[Array, list[str], list[str]]:
    """Coordinates (n, k) in deg from a CSV, the labels of its ``pose`` column, and remarks.

    Raises
    ------
    InputErrors
        Every cell that is no finite number, with line and column.
    InputError
        The file or a column is missing.
    """
    if not file.is_file():
        raise InputError("pose table", value=str(file), allowed="an existing CSV file")
    try:
        table = pd.read_csv(
            file, dtype=str, keep_default_na=False, encoding="utf-8-sig", skipinitialspace=True
        )
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise InputError(f"pose table {file} cannot be read ({error})") from error
    table.columns = [str(c).strip() for c in table.columns]
    missing = [name for name in names if name not in table.columns]
    if len(missing) == len(names):
        raise InputError(f"pose table {file}: no joint column", allowed=", ".join(names))
    if table.empty:
        raise InputError(f"pose table {file} has no rows")
    remarks = [f"{file}: column {name} is missing and taken as 0" for name in missing]
    values = np.zeros((len(table), len(names)))
    faults = []
    for j, name in enumerate(names):
        if name in missing:
            continue
        for i, cell in enumerate(table[name]):
            try:
                values[i, j] = float(cell)
            except ValueError:
                values[i, j] = math.nan
            if not math.isfinite(values[i, j]):
                faults.append(
                    InputError(f"{file}, line {i + 2}, column {name}", value=cell, allowed="a finite number")
                )
    if faults:
        raise faults[0] if len(faults) == 1 else InputErrors(str(file), faults)
    labels = (
        [str(v) for v in table["pose"]]
        if "pose" in table.columns
        else [str(i + 1) for i in range(len(table))]
    )
    return values, labels, remarks
