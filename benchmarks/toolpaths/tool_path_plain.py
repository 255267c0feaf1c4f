"""Plain readers of APT and of Heidenhain's language that share no code with the project's: where each statement ends.

Each is as simple as its language lets it be: ends of statements in mm, circles of arcs, no state of the machine.
:mod:`tool_path_corpus` compares them with the project's readers, line by line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class End:
    """Where the statement of a line ends, mm; circle: centre and radius mm of its arc; hole: a drill cycle is there."""

    line: int
    point: tuple[float, float, float]
    circle: tuple[tuple[float, float, float], float] | None = None
    hole: bool = False


def apt(file: Path) -> Iterator[End]:
    """Ends of GOTO, FROM, GODLTA and of arcs; of drill cycles the place at the height where feed begins."""
    scale, cycle, circle = 1.0, False, None
    here: tuple[float, ...] = ()
    for number, text in _apt_statements(file):
        word, _, rest = text.partition("/")
        word = word.replace(" ", "")
        numbers = [float(x) for x in re.findall(r"(?<![A-Z])[-+]?(?:\d+\.?\d*|\.\d+)(?:[ED][-+]?\d+)?", rest)]
        if word in ("UNITS", "UNIT"):
            scale = 1.0 if "MM" in rest or "MILLI" in rest else 25.4
        elif word == "CYCLE":
            cycle = re.match(r"\s*(?:OFF|INIT|NOMORE)", rest) is None
        elif word in ("TOOLPATH",):
            cycle = False
        elif word in ("CIRCLE", "MOVARC"):
            circle = tuple(scale * x for x in numbers[:3])
        elif word == "GODLTA" and len(numbers) == 3 and here:
            here = tuple(a + scale * b for a, b in zip(here, numbers, strict=True))
            yield End(number, here)  # type: ignore[arg-type]
        elif word in ("GOTO", "FROM"):
            # An arc of Creo has all its points in one statement.
            end = numbers[-3:] if circle and len(numbers) > 6 else numbers[:3]
            here = tuple(scale * x for x in end)
            radius = math.dist(here, circle) if circle else 0.0
            yield End(number, here, (circle, radius) if circle else None, cycle)  # type: ignore[arg-type]
            circle = None


def _apt_statements(file: Path) -> Iterator[tuple[int, str]]:
    held, first, comment = "", 0, False
    for number, raw in enumerate(file.read_text(encoding="latin-1").splitlines(), 1):
        text = raw.strip()
        if text.startswith("$$") or comment:
            comment = text.endswith("$")
            continue
        text = text.partition("$$")[0].strip()
        if text.upper().startswith(("PPRINT", "INSERT", "PARTNO", "TPRINT", "DISPLAY", "REMARK")):
            continue
        first = first if held else number
        if text.endswith("$"):
            held += text[:-1] + " "
            continue
        yield first, (held + text).upper()
        held = ""


def klartext(file: Path, start: tuple[float, float, float]) -> Iterator[End]:
    """Ends of L, LP, C, CP, CR and CT, datum shifts added; ValueError for labels, RND, PLANE and formulas."""
    text = file.read_text(encoding="latin-1")
    if re.search(r"\b(?:LBL|RND|CHF|PLANE|FN ?\d|ROT|APPR|DEP|LN)\b", text) or re.search(r"[XYZ][-+]?Q\d", text):
        raise ValueError("labels, corners or parameters")
    here, pole, shift, modal, angle, radius = list(start), [0.0, 0.0, 0.0], [0.0] * 3, False, 0.0, 0.0
    plane, lost = (0, 1), set[int]()
    scale = 25.4 if re.search(r"BEGIN PGM.*INCH", text) else 1.0
    old = False
    for number, raw in enumerate(text.splitlines(), 1):
        line = re.sub(r"\([^)]*\)?|;.*", " ", re.sub(r"^\s*\d+\s+", "", raw.replace(",", "."))).strip().upper()
        old = old or re.match(r"CYCL DEF 1\.0", line) is not None
        if shifted := re.match(r"CYCLE? DEF 7\.\d\s+([XYZ])\s*([-+\d.]+)", line):
            k = "XYZ".index(shifted[1])
            here[k] += shift[k] - scale * float(shifted[2])
            shift[k] = scale * float(shifted[2])
        head = re.match(r"(LP|L|CC|CP|CR|CT|C|M\d+)\b", line)
        if head is None:
            continue
        word = head[1]
        v = {a: float(b) for a, b in re.findall(r"(IPR|IPA|PR|PA|I?[XYZ]|R)\s*([-+]?\d*\.?\d+)", line[len(word) :])}
        codes = {int(x) for x in re.findall(r"M\s*(\d+)", line)}
        xyz = {k: v for k, v in v.items() if k[-1] in "XYZ"}
        if word == "CC":
            for name, value in xyz.items():
                k = "XYZ".index(name[-1])
                pole[k] = scale * value + (here[k] if name[0] == "I" else 0.0)
            if not xyz:
                pole = list(here)
            axes = sorted({"XYZ".index(name[-1]) for name in xyz})
            plane = {(0, 1): (0, 1), (0, 2): (2, 0), (1, 2): (1, 2)}.get(tuple(axes), plane)
            continue
        if codes & {91, 92, 140}:
            lost |= {"XYZ".index(n[-1]) for n in xyz} | ({2} if 140 in codes else set())
            continue
        before = list(here)
        if word in ("LP", "CP"):
            a, b = plane
            if word == "CP" or "IPA" in v or "IPR" in v or "PA" in v:
                if word == "CP":
                    radius = math.hypot(here[a] - pole[a], here[b] - pole[b])
                angle0 = math.degrees(math.atan2(here[b] - pole[b], here[a] - pole[a]))
                angle = v["PA"] if "PA" in v else angle0 + v.get("IPA", 0.0)
            radius = scale * v["PR"] if "PR" in v else radius
            here[a] = pole[a] + radius * math.cos(math.radians(angle))
            here[b] = pole[b] + radius * math.sin(math.radians(angle))
            lost -= {a, b}
        for name, value in xyz.items():
            k = "XYZ".index(name[-1])
            here[k] = scale * value + (here[k] if name[0] == "I" else 0.0)
            lost.discard(k)
        circle = None
        if word in ("C", "CP"):
            centre = list(here)
            centre[plane[0]], centre[plane[1]] = pole[plane[0]], pole[plane[1]]
            circle = (
                tuple(c + s for c, s in zip(centre, shift, strict=True)),
                math.hypot(*(before[k] - pole[k] for k in plane)),
            )
        modal = (modal or 89 in codes) and 99 not in codes
        if not lost and (xyz or word in ("LP", "CP", "C")):
            out = tuple(h + s for h, s in zip(here, shift, strict=True))
            yield End(number, out, circle, bool(codes & {89, 99}) or modal)  # type: ignore[arg-type]
        if (codes & {89, 99} or modal) and not old:
            # Where the tool goes back to behind a cycle is a parameter of it.
            lost.add(2)
