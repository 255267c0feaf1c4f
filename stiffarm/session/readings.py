"""Measurement tables and schemes as commands take them: given or bundled, checked, their remarks said."""

from __future__ import annotations

from pathlib import Path

from doe import Campaign, Measurements, bundled_campaign, bundled_data, load_campaign, read_measurements
from robots import InputError, Robot

# Stands for the robot's own table among several; a table's name ends in .csv or .xlsx.
BUNDLED = "bundled"


def read_data(robot: Robot, file: Path | None) -> Measurements:
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
            code="A011",
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
        scheme = load_campaign(file)
        scheme.check_against(robot)
        if scheme.robot != robot.name:
            raise InputError(
                f"scheme file {file} is for robot",
                code="A010",
                value=scheme.robot,
                allowed=robot.name,
                remedy="choose the scheme of this robot, or name this robot in its 'robot' key",
            )
        return scheme
    scheme_or_none = bundled_campaign(robot.name)
    if scheme_or_none is None:
        raise InputError(
            f"no calibration scheme is bundled for {robot.name}",
            code="A011",
            remedy="give a scheme TOML with --scheme-file, or use --scheme global",
        )
    return scheme_or_none
