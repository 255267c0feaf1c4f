"""Public tool paths beside independent readers, move by move: how much is read, and whether it is read right.

    python benchmarks/toolpaths/tool_path_corpus.py FOLDER --rs274 PROGRAM [--page]

FOLDER: files of public repositories, each in a folder named after its repository (OWNER+NAME), and ``sources.csv``
with repository, commit and licence of each. PROGRAM: the stand-alone interpreter of LinuxCNC (GPL-2.0, run as a program
of its own). Files are tried and never kept in the project. Every file is read with what the remedies of a refusal ask
for where it does not say it (``--units mm``, ``--read start=0,0,0``: both are what the interpreter begins with).

A move of G-code is equal where its end agrees to the interpreter's four decimals (of a millimetre or an inch) and each
point of an arc lies on the interpreter's circle to 5 um. APT and Heidenhain's language are compared with
:mod:`tool_path_plain`, statement by statement. ``--page`` writes docs/validation/tool_path_corpus.md.
"""

from __future__ import annotations

import json
import re
import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from string import Template

import numpy as np
import tool_path_plain as plain
from numpy.typing import NDArray

from benchmarks.asked import asked
from machining.toolpaths.gcode.reader import read_gcode
from machining.toolpaths.motions import Motions
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.reading import read_toolpath
from robots import InputError

PAGE = Path(__file__).parents[2] / "docs" / "validation" / "tool_path_corpus.md"
LANGUAGES = ("APT and CLS", "Heidenhain", "G-code")
# Outcomes that rates are of.
SPLINE = re.compile(r"\bG0?5(?:\.[12])?\b", re.I)
FAIR = ("read", "read, not compared", "differs", "refused")
PLAIN = (".apt", ".cls", ".clsf", ".ncl", ".aptsource", ".h")
SUFFIXES = (".ngc", ".nc", ".tap", ".gcode", ".gc", ".cnc", ".mpf")
ON_ARC_mm = 0.005
# The interpreter prints four decimals of its unit.
END = 1.2e-4
LONGEST_S = 60
MACRO = re.compile(
    r"^\s*(?:N\d+\s*)?O\s*(?:<[^>]*>|\d+|\[[^\]]*\])\s*(?:sub|endsub|if|elseif|else|endif|while|endwhile|do|repeat|"
    r"endrepeat|call|return|break|continue)\b|\b(?:GOTO|WHILE\s*\[|IF\s*\[)",
    re.I | re.M,
)
CONSTRUCTS = {
    "tilted planes and vectors (G68.2, CYCLE800, TRAORI)": re.compile(r"\bG68\.2|CYCLE800|TRAORI", re.I),
    "variables and expressions": re.compile(r"#\s*[\d<]|\["),
    "arcs": re.compile(r"\bG0?[23]\b", re.I),
    "drill cycles": re.compile(r"\bG(?:73|8[1-9])\b", re.I),
    "subprograms (M98)": re.compile(r"\bM98\b", re.I),
    "origins moved or turned (G52, G68, G92)": re.compile(r"\bG(?:52|68|92)\b", re.I),
    "inches": re.compile(r"\bG20\b", re.I),
    "splines (G5, G6.2)": re.compile(r"\bG(?:0?5(?:\.[12])?|6\.2)\b", re.I),
    "rotary axes": re.compile(r"(?<![A-Z#<])[ABC]\s*[-+]?[\d.]", re.I),
    "cutter compensation": re.compile(r"\bG4[12]\b", re.I),
}
Floats = NDArray[np.float64]


@dataclass
class Canonical:
    """Moves of the interpreter: ends (n, 3) mm to ``end_mm``, rapid or not, circle of an arc (centre, normal)."""

    end_mm: float = END
    ends: list[Floats] = field(default_factory=list)
    rapid: list[bool] = field(default_factory=list)
    circles: list[tuple[Floats, int] | None] = field(default_factory=list)


@dataclass(frozen=True)
class Compared:
    """One file: what came of it, moves that were compared, the largest difference."""

    name: str
    outcome: str
    why: str = ""
    moves: int = 0
    largest_mm: float = 0.0
    constructs: tuple[str, ...] = ()


def canonical(program: Path, file: Path) -> Canonical | str:
    """What the interpreter makes of a file, or why it refuses it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "t.tbl").write_text("".join(f"T{k} P{k} Z0 D1 ;\n" for k in range(1, 200)))
        # G64 lets the interpreter leave points out that lie nearly on a line; G61 does not, and is the first block.
        text = re.sub(rb"(?i)\bG64(?:\s*[PQ][-+.\d\[\]#<>_a-z]*)*", b"G61", file.read_bytes())
        # Messages of one simulator have brackets within brackets.
        text = re.sub(rb"(?m)^\(\$.*$", b"", text)
        # A program between percent signs may end without M2.
        if not re.search(rb"\n\s*%\s*$", text):
            text += b"\nM2\n"
        (folder / "part.ngc").write_bytes(re.sub(rb"\A(\s*%[^\n]*\n)?", rb"\1G61 F1000\n", text, count=1))
        command = [str(program), "-g", "-n", "2", "-t", "t.tbl", "part.ngc", "out.txt"]
        try:
            done = subprocess.run(  # noqa: S603 - a program that the user names
                command, cwd=folder, capture_output=True, timeout=LONGEST_S, check=False, text=True, errors="replace"
            )
        except subprocess.TimeoutExpired:
            return "takes longer than a minute"
        if done.returncode or not (folder / "out.txt").exists():
            return (done.stderr.strip().splitlines() or ["stopped"])[-1][:80]
        made = (folder / "out.txt").read_text(encoding="latin-1")
    if "PROGRAM_END" not in made and "PROGRAM_STOP" not in made and done.stderr.count("\n") > 1:
        return done.stderr.strip().splitlines()[-1][:80]
    return _parsed(made)


def _parsed(text: str) -> Canonical:
    """Moves in the frame of the work offset, which is the caller's; G92 is the program's."""
    out, scale, plane = Canonical(), 1.0, 2
    g92 = np.zeros(3)
    for call, inside in re.findall(r"([A-Z0-9_]+)\((.*)\)\s*$", text, re.M):
        # A line number of six digits stands close to its call.
        call = re.sub(r"^N[\d.]+", "", call)
        if call == "USE_LENGTH_UNITS":
            scale = {"CANON_UNITS_MM": 1.0, "CANON_UNITS_INCHES": 25.4}[inside]
            out.end_mm = max(out.end_mm, END * scale)
        elif call == "SELECT_PLANE":
            plane = {"CANON_PLANE_XY": 2, "CANON_PLANE_XZ": 1, "CANON_PLANE_YZ": 0}.get(inside, 2)
        elif call in ("SET_G92_OFFSET", "STRAIGHT_TRAVERSE", "STRAIGHT_FEED", "ARC_FEED"):
            v = scale * np.array([float(x) for x in inside.split(",")])
            if call == "SET_G92_OFFSET":
                g92 = v[:3]
                continue
            end, circle = v[:3] + g92, None
            if call == "ARC_FEED":
                first, second = [(1, 2), (2, 0), (0, 1)][plane]
                end, centre = np.zeros(3), np.zeros(3)
                end[[first, second, plane]] = v[[0, 1, 5]]
                centre[[first, second, plane]] = v[[2, 3, 5]]
                end, circle = end + g92, (centre + g92, plane)
            out.ends.append(end)
            out.rapid.append(call == "STRAIGHT_TRAVERSE")
            out.circles.append(circle)
    return out


def compare(mine: Motions, theirs: Canonical, *, skip_rapid: bool) -> tuple[int, float, str]:
    """Moves that agree, the largest difference in mm, and what differs ("" for nothing).

    ``skip_rapid``: rapid moves to places of the machine are retracts of ours: theirs may be missing, and ours, which
    are above everything else, do not count.
    """
    points = 1e3 * np.asarray(mine.points)
    if skip_rapid and any(note.text.startswith("retracts") for note in mine.notes):
        points = points[~mine.rapid | (points[:, 2] < points[:, 2].max() - 1e-6)]
    k, largest, here = 0, 0.0, np.zeros(3)
    for i, (end, rapid, circle) in enumerate(zip(theirs.ends, theirs.rapid, theirs.circles, strict=True)):
        if circle is None and np.linalg.norm(end - here) < theirs.end_mm:
            k += k < len(points) and np.linalg.norm(points[k] - end) < theirs.end_mm
            here = end
            continue
        # Moves of no length are no moves; an arc shorter than what is printed is one of these.
        first = k
        while k < len(points) and np.linalg.norm(points[k] - here) < theirs.end_mm:
            k += 1
        if circle is not None and np.linalg.norm(end - here) < 3 * theirs.end_mm and k > first:
            beside = k == len(points) or abs(points[k] - here)[circle[1]] > 2 * theirs.end_mm
            if beside or _off_circle(points[k], here, *circle) > ON_ARC_mm:
                here = end
                continue
        at = k
        while at < len(points) and np.linalg.norm(points[at] - end) >= theirs.end_mm:
            # A line may be in two parts, an arc is in many.
            off = _off_line(points[at], here, end) if circle is None else _off_circle(points[at], here, *circle)
            if off > (ON_ARC_mm if circle is not None else theirs.end_mm):
                break
            largest = max(largest, off)
            at += 1
        if at >= len(points) or np.linalg.norm(points[at] - end) >= theirs.end_mm:
            if rapid and skip_rapid:
                here = end
                continue
            got = "none" if at >= len(points) else np.array2string(points[at], precision=3)
            return i, largest, f"move {i + 1}: {np.array2string(end, precision=3)} mm, ours {got}"
        largest = max(largest, float(np.linalg.norm(points[at] - end)))
        k, here = at + 1, end
    left = sum(np.linalg.norm(points[j] - points[j - 1]) > theirs.end_mm for j in range(max(k, 1), len(points)))
    return len(theirs.ends), largest, f"{left} moves of ours behind the last one" if left else ""


def _off_line(point: Floats, a: Floats, b: Floats) -> float:
    """Distance of a point from the line from a to b; infinite beyond its ends."""
    along = (b - a) / np.linalg.norm(b - a)
    t = float((point - a) @ along)
    return float(np.linalg.norm(point - a - t * along)) if 0.0 <= t <= np.linalg.norm(b - a) else np.inf


def _off_circle(point: Floats, start: Floats, centre: Floats, plane: int) -> float:
    flat = [a for a in range(3) if a != plane]
    return abs(float(np.linalg.norm((point - centre)[flat]) - np.linalg.norm((start - centre)[flat])))


def judged(program: Path, file: Path, name: str) -> Compared:
    """Read one file in both ways."""
    text = file.read_text(encoding="latin-1")
    constructs = ("G-code", *(what for what, pattern in CONSTRUCTS.items() if pattern.search(text)))
    if MACRO.search(text):
        return Compared(name, "macro", constructs=constructs)
    theirs = canonical(program, file)
    if not isinstance(theirs, str) and not theirs.ends:
        return Compared(name, "no motion", constructs=constructs)
    try:
        mine = read_gcode(file, ReadOptions(units="mm", start=(0.0, 0.0, 0.0)))
    except InputError as error:
        if "no motion in the file" in str(error):
            return Compared(name, "no motion", constructs=constructs)
        outcome = "refused by both" if isinstance(theirs, str) else "refused"
        return Compared(name, outcome, _short(str(error), file.name), constructs=constructs)
    if isinstance(theirs, str):
        return Compared(name, "read, not compared", f"the interpreter refuses it: {theirs}", constructs=constructs)
    machine = re.search(r"\bG(?:28|30|53)\b", text, re.I) is not None
    moves, largest, differs = compare(mine, theirs, skip_rapid=machine)
    if differs and SPLINE.search(text):
        said = "the stand-alone interpreter prints no moves of splines"
        return Compared(name, "read, not compared", said, constructs=constructs)
    return Compared(name, "differs" if differs else "read", differs, moves, largest, constructs)


def judged_plainly(file: Path, name: str) -> Compared:
    """An APT file or one of Heidenhain's, beside the plain readers: where each of its statements ends."""
    start = (0.0, 0.0, 0.0)
    heidenhain = file.suffix.lower() == ".h" or "BEGIN PGM" in file.read_text(encoding="latin-1")[:400]
    constructs = ("Heidenhain",) if heidenhain else ("APT and CLS",)
    if heidenhain and re.search(r"FN ?(?:9|1[0-2]|18)\b|TCH PROBE|CALL PGM", file.read_text(encoding="latin-1")):
        return Compared(name, "macro", constructs=constructs)
    try:
        mine = read_toolpath(file, options=ReadOptions(units=None if heidenhain else "mm", start=start))
    except InputError as error:
        if "no motion in the file" in str(error) or _motionless(file, heidenhain=heidenhain):
            return Compared(name, "no motion", constructs=constructs)
        return Compared(name, "refused", _short(str(error), file.name), constructs=constructs)
    try:
        ends = list(plain.klartext(file, start) if heidenhain else plain.apt(file))
    except ValueError as error:
        return Compared(name, "read, not compared", str(error), constructs=constructs)
    largest, differs = 0.0, ""
    for end in ends:
        rows = np.flatnonzero(mine.line == end.line)
        points = 1e3 * mine.points[rows]
        if not len(points):
            differs = differs or f"line {end.line}: no move"
            continue
        if end.hole:
            # A hole is on the line of the tool axis through its place.
            off = points - end.point
            axes = mine.axes[rows]
            miss = float(np.linalg.norm(off - np.sum(off * axes, axis=1)[:, None] * axes, axis=1)[1:].max(initial=0.0))
        else:
            miss = float(np.linalg.norm(points[-1] - end.point))
            if end.circle is not None:
                levers = np.linalg.norm(points - np.array(end.circle[0]), axis=1)
                # A helix leaves the sphere about its centre.
                flat = bool((np.ptp(points, axis=0) < 1e-9).any())
                off = float(np.abs(levers - end.circle[1]).max()) if flat else 0.0
                miss = max(miss, 0.0 if off < ON_ARC_mm else off)
        if miss > END:
            differs = differs or f"line {end.line}: {miss:.4g} mm"
        largest = max(largest, miss)
    return Compared(name, "differs" if differs else "read", differs, len(ends), largest, constructs)


def _motionless(file: Path, *, heidenhain: bool) -> bool:
    """Whether no statement of a file is one of motion."""
    words = r"^\s*(?:\d+\s+)?(?:LP?|LN|C[CPRT]?)\s" if heidenhain else r"^\s*(?:GOTO|FROM|GODLTA|GOHOME)\s*/"
    return re.search(words, file.read_text(encoding="latin-1"), re.I | re.M) is None


def _short(message: str, name: str) -> str:
    line = next((x for x in message.splitlines()[1:] if x.strip()), message)
    return re.sub(r"^\s*-\s*", "", line).replace(name, "").split(": got")[0].split(", line", 1)[-1][:110]


def files(folder: Path) -> Iterator[tuple[str, Path]]:
    """Files of the corpus with the repository that each is from."""
    for file in sorted(folder.rglob("*")):
        if file.is_file() and _suffix(file) in (*SUFFIXES, *PLAIN):
            yield file.relative_to(folder).parts[0].replace("+", "/"), file


def _suffix(file: Path) -> str:
    """The suffix; Creo counts its versions behind it."""
    return Path(re.sub(r"\.\d+$", "", file.name)).suffix.lower()


def _judged(program: Path, file: Path) -> Compared:
    if _suffix(file) in PLAIN or "BEGIN PGM" in file.read_text(encoding="latin-1")[:400]:
        return judged_plainly(file, file.name)
    return judged(program, file, file.name)


def table(rows: Sequence[tuple[str, Compared]]) -> str:
    """Rates by repository and by construct."""
    out = [
        "| of | files without macros | read | of these each move equal | not compared | differs | refused by line |",
        "|---|---|---|---|---|---|---|",
    ]
    fair = [(repo, r) for repo, r in rows if r.outcome in FAIR]
    groups = [(repo, [r for x, r in fair if x == repo]) for repo in dict.fromkeys(x for x, _ in fair)]
    groups.append(("all", [r for _, r in fair]))
    groups += [
        (what if what in LANGUAGES else f"G-code with {what}", [r for _, r in fair if what in r.constructs])
        for what in (*LANGUAGES, *CONSTRUCTS)
    ]
    for name, some in groups:
        if not some:
            continue
        count = Counter(r.outcome for r in some)
        done = len(some) - count["refused"]
        share = f"{100 * done / len(some):.0f} %" if some else "-"
        out.append(
            f"| {name} | {len(some)} | {done} ({share}) | {count['read']} | {count['read, not compared']} "
            f"| {count['differs']} | {count['refused']} |"
        )
    return "\n".join(out)


def refusals(rows: Sequence[tuple[str, Compared]]) -> str:
    """What is refused, most often first."""
    count = Counter(
        re.sub(r"^ ?\d+: |[-+]?\d+\.\d+|^.*?: (?=a )", "", r.why)[:70] for _, r in rows if r.outcome == "refused"
    )
    return "\n".join(f"| {why.replace('|', '/')} | {n} |" for why, n in count.most_common())


def page(rows: Sequence[tuple[str, Compared]], sources: str) -> str:
    """The page of the documentation, from its template."""
    equal = [r for _, r in rows if r.outcome == "read"]
    count = Counter(r.outcome for _, r in rows)
    fair = {name: [r for _, r in rows if name in r.constructs and r.outcome in FAIR] for name in LANGUAGES}
    done = {name: sum(r.outcome != "refused" for r in some) for name, some in fair.items()}
    share = {name: f"{100 * done[name] / max(len(some), 1):.0f} %" for name, some in fair.items()}
    everything = len(fair["G-code"]) + count["refused by both"]
    lines = ["| repository | commit | licence |", "|---|---|---|"]
    lines += [f"| {' | '.join(line.split(','))} |" for line in sources.splitlines() if line.strip()]
    return Template((Path(__file__).with_name("tool_path_corpus_page.md")).read_text(encoding="utf-8")).substitute(
        table=table(rows),
        sources="\n".join(lines),
        files=len(rows),
        macros=count["macro"],
        empty=count["no motion"],
        bad=count["refused by both"],
        moves=sum(r.moves for r in equal),
        largest=f"{1e3 * max((r.largest_mm for r in equal), default=0.0):.2g}",
        refused=refusals(rows),
        differ=count["differs"] or "none",
        apt=share["APT and CLS"],
        heidenhain=share["Heidenhain"],
        gcode=share["G-code"],
        gcode_all=f"{100 * done['G-code'] / max(everything, 1):.0f} %",
    )


def main() -> None:
    """Compare all files of a folder."""
    a = asked(__doc__, "folder", rs274={"type": Path, "required": True}, page=False)
    rows = [(repo, _judged(a.rs274, file)) for repo, file in files(a.folder)]
    (a.folder / "corpus.json").write_text(json.dumps([[repo, vars(r)] for repo, r in rows], indent=1), encoding="utf-8")
    print(table(rows))
    print(Counter(r.outcome for _, r in rows))
    print(
        f"{sum(r.moves for _, r in rows if r.outcome == 'read')} moves, largest difference "
        f"{1e3 * max((r.largest_mm for _, r in rows if r.outcome == 'read'), default=0.0):.2g} um"
    )
    if a.page:
        sources = a.folder / "sources.csv"
        PAGE.write_text(page(rows, sources.read_text(encoding="utf-8") if sources.exists() else ""), encoding="utf-8")


if __name__ == "__main__":
    main()
