"""Read a tool path file of any kind that is known."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path

import numpy as np

from machining.task import ToolPath
from machining.toolpaths.apt.reader import read_apt
from machining.toolpaths.gcode.reader import read_gcode
from machining.toolpaths.heidenhain.reader import read_heidenhain
from machining.toolpaths.motions import Motions, Note
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.robot_programs import refuse_robot_program
from machining.toolpaths.source import content, lines
from machining.toolpaths.tables import MARK, read_motions, read_path
from robots import InputError
from robots.files.reading import recording

SUFFIXES = {
    "apt": (".apt", ".aptsource", ".cls", ".clsf", ".ncl", ".cl", ".cld", ".cldata"),
    "gcode": (".nc", ".ngc", ".tap", ".cnc", ".mpf", ".spf", ".gcode", ".gc", ".eia", ".iso", ".min", ".din"),
    "heidenhain": (".h", ".hnc"),
    "csv": (".csv",),
}
KINDS = tuple(SUFFIXES)
_APT = re.compile(
    r"^\s*(?:(?:GOTO|FROM|TOOL PATH|FEDRAT|LOADTL|LOAD|CUTTER|TLDATA|MSYS|UNITS?|SPINDL|CYCLE|PAINT|COOLNT|CIRCLE)\s*/"
    r"|PARTNO|RAPID\b|MULTAX|PPRINT|\$\$|FINI\b|END-OF-PATH)",
    re.I,
)
_GCODE = re.compile(r"^\s*(?:%|/|\(|O\d+|(?:N\d+\s*)?(?:[GMTSF]\s*\d|[XYZABC]\s*[-+.\d]))", re.I)
_HEIDENHAIN = re.compile(r"^\s*\d*\s*BEGIN PGM", re.I)
_SAMPLE = 400
# Bytes that tell a robot program: its commands begin within them.
_HEAD = 32_768


@recording()
def read_toolpath(path: str | Path, *, kind: str | None = None, options: ReadOptions | None = None) -> Motions:
    """Read APT, CLSF, G-code, Heidenhain's language, a path in CSV (:func:`machining.read_path`) or motions in CSV.

    Parameters
    ----------
    path : the file
    kind : "apt", "gcode", "heidenhain" or "csv"; None: by the name's suffix and the first lines, which must agree
    options : see :class:`ReadOptions`

    Raises
    ------
    InputError
        A kind that is not known or not clear, and what the readers raise. Surface normals of a path in CSV are not
        kept; :func:`machining.read_path` gives them.
    """
    path, options = Path(path), options or ReadOptions()
    if kind is not None and kind not in KINDS:
        raise InputError("kind of the tool path", code="P001", value=kind, allowed=", ".join(KINDS))
    data = content(path, options.max_bytes)
    refuse_robot_program(path.name, data[:_HEAD].decode("latin-1").splitlines())
    kind = kind or _kind(path)
    if kind == "apt":
        return read_apt(path, options)
    if kind == "gcode":
        return read_gcode(path, options)
    if kind == "heidenhain":
        return read_heidenhain(path, options)
    return read_motions(path, options.max_bytes) if data.startswith(MARK.encode()) else _path(path)


def _kind(path: Path) -> str:
    by_name = next((kind for kind, suffixes in SUFFIXES.items() if path.suffix.lower() in suffixes), None)
    if by_name == "csv":
        return by_name
    head = list(islice(lines(path), _SAMPLE))
    if by_name == "heidenhain" or any(_HEIDENHAIN.match(line) for line in head[:20]):
        return "heidenhain"
    apt, gcode = (sum(pattern.match(line) is not None for line in head) for pattern in (_APT, _GCODE))
    by_content = "apt" if apt > gcode else "gcode" if gcode > apt else None
    remedy = "say it: --kind apt, gcode, heidenhain or csv (kind= in Python)"
    if by_content is None and by_name is None:
        raise InputError(
            f"{path.name}: kind of tool path not clear", code="P001", allowed=", ".join(KINDS), remedy=remedy
        )
    if by_content and by_name and by_content != by_name:
        what = f"{path.name}: its suffix says {by_name}, its lines look like {by_content}"
        raise InputError(what, code="P001", allowed="one kind", remedy=remedy)
    return by_content or by_name or ""


def _path(path: Path) -> Motions:
    """Motions of a path in CSV: all at feed, one tool, no operation."""
    found = read_path(path)
    numbers = [i for i, line in enumerate(lines(path), start=1) if line.strip().strip(",")]
    n = found.n
    # A quoted cell may run over lines; then rows cannot be told from lines.
    line = np.array(numbers[1:] if len(numbers) == n + 1 else [0] * n, dtype=np.int64)
    return Motions(
        points=found.points,
        axes=found.axes,
        rapid=np.zeros(n, dtype=bool),
        feed=found.feed,
        line=line,
        tool=np.zeros(n, dtype=np.int64),
        spindle=np.full(n, np.nan),
        dwell=np.zeros(n),
        operation=np.zeros(n, dtype=np.int64),
        notes=_tilted(found),
        source=path.name,
    )


def _tilted(path: ToolPath) -> tuple[Note, ...]:
    """A note where the tool does not stand along the surface normals, which motions do not keep."""
    cosine = np.einsum("ni,ni->n", path.normals, path.axes)
    if (cosine > 1.0 - 1e-9).all():
        return ()
    return (Note(0, "surface normals are left out: a program needs the tool axis only, and k_fs is taken along that"),)
