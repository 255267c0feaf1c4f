"""Tasks for OpenSees, which runs in a process beside ours (worker.py)."""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Solver:
    """One process of OpenSees; tasks go in one by one."""

    def __init__(self) -> None:
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and file
            [sys.executable, str(Path(__file__).with_name("worker.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},  # Frames are small: threads would only wait for one another.
        )

    def run(self, task: dict[str, Any]) -> Array:
        """Displacements (n, 6) in m and rad at the legs to be read. RuntimeError: no solution, or no OpenSees here."""
        assert self._process.stdin
        assert self._process.stdout
        try:
            self._process.stdin.write(json.dumps(task) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            self._said.seek(0)
            raise RuntimeError(f"OpenSees does not run: {self._said.read().decode(errors='replace')[-800:]}")
        answer = json.loads(line)
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return np.array(answer["found"], dtype=float).reshape(-1, 6)

    def close(self) -> None:
        """End the process."""
        if self._process.stdin:
            self._process.stdin.close()
        self._process.wait(timeout=20)
        if self._process.stdout:
            self._process.stdout.close()
        self._said.close()


@cache
def solver() -> Solver:
    """The one that is shared; it ends with our process."""
    one = Solver()
    atexit.register(one.close)
    return one
