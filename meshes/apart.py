"""Programs of C++ libraries that end their process on some inputs: run in a process of their own, arrays in and out."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robots.files.written import tidied_by


class ApartError(Exception):
    """The process gave no result; says why."""


def run_apart(
    program: str, arguments: Sequence[str], arrays: Mapping[str, NDArray[np.generic]], timeout_s: float
) -> dict[str, NDArray[np.generic]]:
    """Arrays that a Python program makes of ``arrays``.

    Parameters
    ----------
    program : a constant text; its first two arguments are the .npz file to read and the one to write
    arguments : the further ones

    Raises
    ------
    ApartError
        The process crashed, raised, took too long, or could not be started.
    """
    with tempfile.TemporaryDirectory() as folder, tidied_by(lambda: shutil.rmtree(folder, ignore_errors=True)):
        source, target = Path(folder) / "given.npz", Path(folder) / "made.npz"
        np.savez(source, **arrays)  # type: ignore[arg-type]  # its stub takes the names for its own keywords
        # -P: what lies in the user's folder is nobody's module.
        command = [sys.executable, "-P", "-c", program, str(source), str(target), *arguments]
        try:
            # The command is this interpreter with a constant text.
            run = subprocess.run(  # noqa: S603
                command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout_s, check=False
            )
            # Libraries may crash on their way out, their work done.
            if target.is_file():
                with np.load(target, allow_pickle=False) as made:
                    return dict(made)
        except subprocess.TimeoutExpired:
            raise ApartError(f"no result after {timeout_s:g} s") from None
        except (OSError, ValueError, KeyError) as error:
            raise ApartError(str(error)) from error
    said = run.stderr.strip().splitlines() or ["no message"]
    raise ApartError(f"code {run.returncode}, {said[-1]}")
