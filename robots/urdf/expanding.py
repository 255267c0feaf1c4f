"""A xacro file expanded to a URDF, where the package xacro is installed."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

from robots.errors import InputError
from robots.files.reading import read_bytes


def expanded(path: Path) -> str:
    """The URDF text that a xacro file makes.

    Raises
    ------
    InputError
        The package is missing, the file asks for what is not here, or it is wrong.
    """
    read_bytes(path, "xacro file")
    by_hand = f"expand it where its packages are, and give the result: xacro {path.name} > {path.stem}.urdf"
    try:
        import xacro
    except ImportError as error:
        raise InputError(
            f"{path.name} is a xacro file, and the package xacro is not installed",
            code="F013",
            remedy=f"pip install 'stiffarm[xacro]', or {by_hand}",
        ) from error
    try:
        # It prints its warnings.
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            return str(xacro.process_file(str(path)).toxml())
    except Exception as error:
        if "$(find" in str(error) or "ament_index" in str(error) or "rospkg" in str(error):
            raise InputError(
                f"{path.name} takes in files of a ROS package ($(find ...)), and ROS is not here",
                code="R012",
                remedy=by_hand,
            ) from error
        raise InputError(
            f"{path.name} cannot be expanded by xacro ({type(error).__name__}: {error})", code="R012", remedy=by_hand
        ) from error
