"""Random programs of Heidenhain's language and of APT, read by the project and by second interpreters, step by step.

    python benchmarks/toolpaths/tool_path_random.py [--programs 100000] [--seed 0] [--language heidenhain] [--workers 2]

A program is lines, arcs, corners, cycles, frames, parameters, labels and words that change nothing, in random order,
and in every third one a statement or a word that must be refused. Each must give what :mod:`tool_path_second` makes of
it (ends and centres to a nanometre, feeds to a millionth), or be refused with the first fault in the same line. Prints
the programs that do not; exit code 1 if there are any.
"""

from __future__ import annotations

import cmath
import math
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import numpy as np
import tool_path_second as second
from tool_path_second import RefusedError, Step

from benchmarks.asked import asked
from machining.toolpaths import Motions, ReadOptions, read_toolpath
from robots import InputErrors

# mm; a nanometre, and what four multiplications of rounded numbers leave in half a metre.
SAME = 1e-6
# rad of an arc's sweep: ends are written to 1e-6 mm on radii of 1 mm and more.
SWEPT = 1e-5
HEIDENHAIN, APT = "heidenhain", "apt"

_STRAY = (
    "R5",
    "PR+3",
    "I5",
    "NX1",
    "HUGO",
    "M136",
    "M103 F50",
    "M777",
    "M124 T0.1",
    "X+1 X+2",
    "RL",
    "FZ0.1",
    "M138 A",
    "IPA+5",
)
_BAD = (
    "CYCL DEF 8.1 X",
    "APPR LT X+1 Y+1 LEN5 F100",
    "CALL PGM ABC",
    "FN 14: ERROR= 5",
    "FN 18: SYSREAD Q5 = ID50",
    "FN 9: IF +Q1 EQU +2 GOTO LBL 3",
    "CYCL DEF 251 POCKET ~ Q215=+0",
    "PLANE AXIAL A+30 STAY",
    "FUNCTION TCPM F CONT AXIS POS",
    "TCH PROBE 413 X",
    "CYCL DEF 7.1 #5",
    "CYCL CALL PAT",
    "FPOL X+0 Y+0",
    "CTP PR",
    "TOOL CALL 7 Z S500 DL+0.1",
    "G1 X5",
)
_QUIET = (
    "* - HEADING",
    "BLK FORM 0.1 Z X-10 Y-10 Z-20",
    "M126",
    "M127",
    "M8",
    "M9",
    "TOOL DEF 4",
    "CYCL DEF 32.0 TOLERANCE",
    "CYCL DEF 32.1 T0.05",
    "CYCL DEF 13.0 ORIENTATION",
)
_BAD_APT = (
    "WIBBLE/3",
    "ROTABL/CLW,90",
    "GOTO/1,2",
    "GOTO/1,2,3,X",
    "TRACUT/LAST",
    "COPY/1,MODIFY,3",
    "RAPID/ZAXIS",
    "AUXFUN/77",
    "PREFUN/54",
    "INSERT/G0 G53 Z0",
    "SPINDL/500,ROUND",
    "LOADTL/3,MODIFY",
    "FEDRAT/INVERS,3",
    "CYCLE/DRILL,FEDTO,5,SLOWFD,3",
    "CUTCOM/NORMDS",
    "OPSKIP/ON",
    "X = 5",
    "CLEARP/XYPLAN,50",
)
_QUIET_APT = (
    "PPRINT/TEXT, WITH GOTO/1,2,3",
    "INTOL/0.01",
    "TPRINT/TOOL",
    "SELECT/TOOL,4",
    "COOLNT/FLOOD",
    "MULTAX/ON",
    "CUTCOM/LEFT",
    "CUTCOM/OFF",
    "LOADTL/3,ADJUST,3,MILL",
    "PAINT/COLOR,3",
    "SEQNO/ON",
)


@dataclass
class Program:
    """A program as text, what it does, and the line of its first fault (0: none)."""

    language: str
    lines: list[str] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)
    fault: int = 0


def number(r: Random, low: float, high: float, places: int = 3) -> str:
    """A number as people and CAM systems write it."""
    value = f"{r.uniform(low, high):.{places}f}"
    value = value.replace(".", ",") if r.random() < 0.1 else value
    return value if value[0] == "-" or r.random() < 0.4 else "+" + value


class Writer:
    """Writes a program in Heidenhain's language while a second interpreter runs it."""

    def __init__(self, r: Random) -> None:
        self.r, self.inch = r, r.random() < 0.15
        self.program = Program(HEIDENHAIN)
        self.control = second.Klartext(inch=self.inch)
        self.body: list[str] | None = None
        self.label = 0
        self.calls: list[tuple[int, list[str]]] = []
        self.spoilt = r.random() < 0.33
        self.count = 0

    def raw(self, text: str) -> int:
        """A line, with its number or none; its number in the file."""
        self.count += 1
        mark = f"{self.count} " if self.r.random() < 0.5 else ""
        tail = self.r.choice(["", "", "", " ;REMARK X+5", " ; ~" if "~" in text else " ;"])
        self.program.lines.append(mark + text + tail)
        return len(self.program.lines)

    def put(self, text: str) -> None:
        """Write a statement and let the interpreter run it."""
        if "~" in text:
            parts = text.split(" ~ ")
            line = self.raw(parts[0] + " ~")
            for k, part in enumerate(parts[1:]):
                self.program.lines.append(f"   {part}" + (" ;TEXT~" if k < len(parts) - 2 else " ;LAST"))
        else:
            line = self.raw(text)
        if self.body is not None:
            self.body.append((line, text.replace(" ~", "")))  # type: ignore[arg-type]
        self.run(line, text.replace(" ~", ""))

    def run(self, line: int, text: str) -> None:
        """One statement in the interpreter; a refusal ends the program."""
        try:
            self.control.take(line, text)
        except RefusedError:
            self.program.fault = line
            raise

    def size(self, low: float, high: float, places: int = 3) -> str:
        """A length in the unit of the program."""
        k = 25.4 if self.inch else 1.0
        return number(self.r, low / k, high / k, places + (2 if self.inch else 0))

    def write(self) -> Program:
        """The whole program."""
        name = "INCH" if self.inch else "MM"
        self.raw(f"BEGIN PGM T {name}")
        try:
            self.put(f"TOOL CALL 3 Z S1000 F{self.r.randint(100, 900)}" + self.r.choice(["", " DR+0.1", " DL+0"]))
            self.put("L X+0 Y+0 Z+20 R0 FMAX M3")
            self.put(f"L Z{self.size(-3, 3)} F{self.r.randint(100, 2000)}")
            for _ in range(self.r.randint(3, 16)):
                if self.spoilt and self.r.random() < 0.15:
                    self.spoil()
                self.one()
            if self.control.corner is None:
                self.control.settle()
        except RefusedError:
            pass
        self.raw("M30")
        for label, body in self.calls:
            for text in (f"LBL {label}", *body, "LBL 0"):
                self.raw(text)
        self.raw(f"END PGM T {name}")
        self.program.steps = self.control.steps
        return self.program

    def spoil(self) -> None:
        """A statement that must be refused."""
        self.control.settle()
        if self.r.random() < 0.5:
            text = self.r.choice(_BAD)
        else:
            words = [f"X{self.size(-50, 50)}", self.r.choice(_STRAY)]
            self.r.shuffle(words)
            text = f"{self.r.choice(['L', 'C', 'CC', 'CT'])} {' '.join(words)} F200"
        self.program.fault = self.raw(text)
        raise RefusedError(text)

    def one(self) -> None:
        """One more thing."""
        kinds = [
            self.line,
            self.line,
            self.circle,
            self.by_radius,
            self.tangent,
            self.polar,
            self.helix,
            self.corner,
            self.quiet,
            self.parameter,
            self.shift,
            self.rotate,
            self.drill,
            self.loop,
            self.call,
            self.plane,
            self.vector,
            self.dwell,
        ]
        self.r.choice(kinds)()

    def ending(self) -> str:
        """Feed and M functions of a line."""
        f = self.r.choice(["", "", f" F{self.r.randint(50, 3000)}", " FAUTO", " FMAX"])
        return self.r.choice(["", " R0"]) + f + self.r.choice(["", "", "", "", " M8", " M9", " M3"])

    def line(self) -> None:
        """A line by some of its coordinates."""
        letters = self.r.sample("XYZ", self.r.randint(1, 3))
        words = [
            self.r.choice(["", "", "I"]) + k + (self.size(-40, 60) if k != "Z" else self.size(-4, 4))
            for k in sorted(letters)
        ]
        self.put("L " + " ".join(words) + self.ending())

    def circle(self) -> None:
        """CC and C to a point of the circle, or all the way round."""
        here, u = self.standing(), self.control.unit
        pair = self.r.choice(["XY", "XY", "XZ", "YZ"])
        a, b = second.PAIRS[frozenset(pair)]
        radius, first = self.r.uniform(2, 40), self.r.uniform(0, 2 * math.pi)
        pole = complex(here[a], here[b]) - cmath.rect(radius, first)
        end = pole + cmath.rect(radius, first + self.r.uniform(0.05, 6.2))
        if self.r.random() < 0.3:
            # Rounded centres relative to the tool, as posts write them.
            self.put(f"CC I{'XYZ'[a]}{(pole.real - here[a]) / u:+.8f} I{'XYZ'[b]}{(pole.imag - here[b]) / u:+.8f}")
        else:
            self.put(f"CC {'XYZ'[a]}{pole.real / u:+.8f} {'XYZ'[b]}{pole.imag / u:+.8f}")
        to = f"{'XYZ'[a]}{end.real / u:+.8f} {'XYZ'[b]}{end.imag / u:+.8f} " if self.r.random() < 0.85 else ""
        self.put(f"C {to}{self.r.choice(['DR+', 'DR-'])}" + self.r.choice(["", " R0", f" F{self.r.randint(50, 900)}"]))

    def by_radius(self) -> None:
        """CR."""
        here, u = self.standing(), self.control.unit
        end = [here[0] + self.r.uniform(1, 30), here[1] + self.r.uniform(-30, 30)]
        half = math.dist(here[:2], end) / 2
        radius = half * self.r.uniform(1.01, 3) * self.r.choice([1, 1, -1])
        self.put(f"CR X{end[0] / u:+.6f} Y{end[1] / u:+.6f} R{radius / u:+.6f} {self.r.choice(['DR+', 'DR-'])}")

    def tangent(self) -> None:
        """CT, or CTP about a pole."""
        if self.control.way is None or abs(self.control.way) < 1e-6:
            return
        here, u = self.standing(), self.control.unit
        bend = self.r.choice([-1, 1]) * self.r.uniform(0.2, 2.5)
        end = complex(here[0], here[1]) + self.control.way / abs(self.control.way) * cmath.rect(
            self.r.uniform(3, 30), bend
        )
        if self.r.random() < 0.3:
            pole = end - cmath.rect(self.r.uniform(2, 20), self.r.uniform(0, 6))
            self.put(f"CC X{pole.real / u:+.6f} Y{pole.imag / u:+.6f}")
            self.put(f"CTP PR{abs(end - pole) / u:.6f} PA{math.degrees(cmath.phase(end - pole)):+.6f}")
        else:
            self.put(f"CT X{end.real / u:+.6f} Y{end.imag / u:+.6f}")

    def polar(self) -> None:
        """LP about a pole, whole and with words left out."""
        if self.r.random() < 0.6 or self.control.pole is None:
            self.put(f"CC X{self.size(-20, 20)} Y{self.size(-20, 20)}")
        for k in range(self.r.randint(1, 4)):
            whole = f"PR{self.positive(5, 40)} PA{number(self.r, -180, 400)}"
            radius, turn = f"PR{self.positive(5, 40)}", f"IPA{number(self.r, -90, 90)}"
            some = [whole, radius, turn, f"PA{number(self.r, 0, 360)}", f"IPR{self.size(1, 5)}", f"{radius} {turn}"]
            words = whole if k == 0 and self.r.random() < 0.95 else self.r.choice(some)
            z = self.r.choice(["", "", f" IZ{self.size(-1, 1)}"])
            z = z if set(self.control.pair) == {0, 1} else ""
            self.put(f"LP {words}{z}{self.ending()}")

    def helix(self) -> None:
        """CP, in one turn or several."""
        here, u = self.standing(), self.control.unit
        pole = complex(here[0], here[1]) + cmath.rect(self.r.uniform(2, 30), self.r.uniform(0, 6))
        self.put(f"CC X{pole.real / u:+.6f} Y{pole.imag / u:+.6f}")
        z = self.r.choice(["", f" IZ{self.size(-2, 2)}"])
        if self.r.random() < 0.6:
            # A quarter of a turn from whole ones, where rounding could add or lose one.
            turn = self.r.choice([-1, 1]) * (self.r.randint(0, 2) * 360 + self.r.uniform(20, 300))
            self.put(f"CP IPA{turn:+.4f}{z}" + self.r.choice(["", " DR+" if turn > 0 else " DR-"]))
        else:
            self.put(f"CP PA{self.r.uniform(0, 360):+.4f}{z} {self.r.choice(['DR+', 'DR-'])}")

    def corner(self) -> None:
        """Two lines at one height with RND or CHF between them."""
        here, u = self.standing(), self.control.unit
        if self.control.modal:
            return
        first, turn = self.r.uniform(0, 2 * math.pi), self.r.choice([-1, 1]) * self.r.uniform(0.2, 2.6)
        one, two = self.r.uniform(5, 40), self.r.uniform(5, 40)
        mid = complex(here[0], here[1]) + cmath.rect(one, first)
        end = mid + cmath.rect(two, first + turn)
        self.put(f"L X{mid.real / u:+.6f} Y{mid.imag / u:+.6f} F{self.r.randint(50, 2000)}")
        room = 0.9 * min(one, two)
        own = self.r.choice(["", "", f" F{self.r.randint(20, 400)}"])
        if self.r.random() < 0.5:
            self.put(f"RND R{self.r.uniform(0.1, 1) * room / math.tan(abs(turn) / 2) / u:.6f}{own}")
        else:
            self.put(f"CHF {self.r.uniform(0.1, 1) * room / u:.6f}{own}")
        self.put(f"L X{end.real / u:+.6f} Y{end.imag / u:+.6f}" + self.r.choice(["", f" F{self.r.randint(50, 2000)}"]))

    def positive(self, low: float, high: float) -> str:
        """A length without a sign."""
        return self.size(low, high).lstrip("+")

    def quiet(self) -> None:
        """A statement that changes nothing."""
        self.put(self.r.choice(_QUIET))

    def parameter(self) -> None:
        """A parameter that is set, and used if it is no large one."""
        k = self.r.randint(1, 9)
        old = self.r.choice(sorted(n for n in self.control.q if n < 100) or [0])
        a = f"Q{old}" if old else f"{self.r.randint(1, 30)}"
        self.put(
            self.r.choice(
                [
                    f"Q{k} = {a} + {self.r.randint(1, 9)} * 2",
                    f"Q{k} = ( {a} - 3 ) / 4",
                    f"FN 0: Q{k} = {number(self.r, -20, 20)}",
                    f"Q{k} = ATAN 1 / 9",
                    f"FN 1: Q{k} = {a} + +5",
                    f"FN 2: Q{k} = {a} - -2,5",
                    f"FN 3: Q{k} = {a} * {number(self.r, -1, 1)}",
                    f"FN 4: Q{k} = {a} DIV +8",
                    f"Q{k} = 10 * SIN 30 + COS 60",
                    f"Q{k} = SQRT 16 + 2 ^ 2 - ABS -3",
                ]
            )
        )
        if abs(self.control.q[k]) < 200:
            self.put(f"L {self.r.choice(['X', 'IX', 'Y'])}{self.r.choice(['+', '-', ''])}Q{k}{self.ending()}")

    def shift(self) -> None:
        """A datum shift."""
        if self.control.plane != second.ONE:
            return
        if self.r.random() < 0.3:
            self.put(
                self.r.choice(["TRANS DATUM RESET", f"TRANS DATUM AXIS X{self.size(-20, 20)} Y{self.size(-9, 9)}"])
            )
            return
        self.put("CYCL DEF 7.0 DATUM SHIFT")
        for k in range(self.r.randint(1, 3)):
            value = self.r.choice([self.size(-30, 30), "+0"])
            self.put(f"CYCL DEF 7.{k + 1} {self.r.choice(['', '', 'I'])}{'XYZ'[k]}{value}")

    def rotate(self) -> None:
        """A rotation."""
        if self.control.plane == second.ONE:
            self.put("CYCL DEF 10.0 ROTATION")
            self.put(f"CYCL DEF 10.1 ROT{self.r.choice(['+0', '+90', number(self.r, -170, 170)])}")

    def drill(self) -> None:
        """A drill cycle and its holes."""
        if abs(self.control.axis()[2] - 1.0) > 1e-9 and self.control.tcp:
            return
        cycle = self.r.choice([200, 201, 203, 240])
        q = [f"Q200={self.positive(1, 4)}", f"Q201={'-' + self.positive(4, 30)}", f"Q206={self.r.randint(50, 500)}"]
        if cycle in (200, 203):
            q += [f"Q202={self.positive(2, 9)}", "Q210=0"]
        q += [f"Q203={self.size(-5, 5)}", f"Q204={self.positive(5, 60)}", f"Q211={self.r.choice(['0', '0.25'])}"]
        if cycle == 203:
            q += ["Q212=0", f"Q213={self.r.randint(0, 2)}", "Q205=1", f"Q256={self.positive(0.1, 0.4)}"]
        if cycle in (201, 203):
            q += [f"Q208={self.r.choice(['0', '400', 'FMAX', '99999'])}"]
        self.put(f"CYCL DEF {cycle} NAME ~ " + " ~ ".join(q))
        if self.r.random() < 0.3:
            self.put("CYCL CALL")
        for k in range(self.r.randint(1, 3)):
            misc = 89 if self.r.random() < 0.2 and not k else 99
            self.put(f"L X{self.size(-50, 50)} Y{self.size(-50, 50)} R0 FMAX M{misc}")
        if self.control.modal:
            self.put(f"L X{self.size(-50, 50)} R0 FMAX M99")

    def loop(self) -> None:
        """A label whose part is repeated."""
        if self.body is not None or self.control.corner:
            return
        self.label += 1
        self.put(f"LBL {self.label}")
        self.body = []
        for _ in range(self.r.randint(1, 3)):
            self.r.choice([self.relative, self.relative, self.quiet])()
        body, self.body = self.body, None
        again = self.r.randint(1, 3)
        self.raw(f"CALL LBL {self.label} REP {again}" + self.r.choice(["", f"/{again}"]))
        for _ in range(again):
            for line, text in body:  # type: ignore[str-unpack]
                self.run(line, text)  # type: ignore[arg-type]

    def relative(self) -> None:
        """A relative line."""
        self.put(f"L IX{self.size(-9, 9)} IY{self.size(-9, 9)}{self.ending()}")

    def call(self) -> None:
        """A subprogram behind M30."""
        if self.body is not None:
            return
        self.label += 1
        body = [f"L IX{self.size(-9, 9)}{self.r.choice(['', ' FMAX'])}" for _ in range(self.r.randint(1, 3))]
        self.raw(f"CALL LBL {self.label}")
        for text in body:
            # Their lines are known at the end only.
            self.run(-1, text)
        self.calls.append((self.label, body))

    def plane(self) -> None:
        """A tilted plane and out of it; X, Y and Z follow, for the swivel moves the axes."""
        if self.control.turned or self.control.tcp or self.control.modal:
            return
        if self.control.plane == second.ONE:
            angles = " ".join(f"SP{k}{number(self.r, -80, 80)}" for k in "ABC")
            self.put(f"PLANE SPATIAL {angles} TURN MB MAX FMAX SEQ- TABLE ROT")
        else:
            self.put("PLANE RESET TURN FMAX")
        self.put(f"L X{self.size(-30, 30)} Y{self.size(-30, 30)} Z{self.size(5, 30)} FMAX")

    def vector(self) -> None:
        """Lines with the tool's direction under M128."""
        if self.control.plane != second.ONE or self.control.turned or self.control.modal:
            return
        self.put("M128")
        for _ in range(self.r.randint(1, 3)):
            t = [f"T{k}{number(self.r, -0.5, 0.5, 5) if k != 'Z' else number(self.r, 0.5, 1, 5)}" for k in "XYZ"]
            self.put(
                f"LN X{self.size(-30, 30)} Y{self.size(-30, 30)} Z{self.size(-3, 9)} {' '.join(t)}"
                + self.r.choice(["", " F300"])
            )
        self.put("LN X+0 Y+0 Z+30 TX+0 TY+0 TZ+1 F500")
        self.put("M129")

    def dwell(self) -> None:
        """A rest."""
        self.control.settle()
        self.put("CYCL DEF 9.0 DWELL TIME")
        self.put(f"CYCL DEF 9.1 DWELL {self.r.choice(['0.5', '1', '2,25'])}")

    def standing(self) -> list[float]:
        """Where the tool stands behind the line that is held."""
        return list(self.control.held[2]) if self.control.held else list(self.control.here)


class AptWriter:
    """Writes an APT file while a second interpreter runs it."""

    def __init__(self, r: Random) -> None:
        self.r, self.inch = r, r.random() < 0.2
        self.program = Program(APT)
        self.file = second.Apt(unit=25.4 if self.inch else 1.0)
        self.spoilt = r.random() < 0.33

    def put(self, text: str) -> None:
        """Write a statement, on one line or two, and let the interpreter run it."""
        line = len(self.program.lines) + 1
        head, comma, rest = text.partition(",")
        if comma and self.r.random() < 0.1 and not text.startswith("PPRINT"):
            self.program.lines += [f"{head},$", f"  {rest}"]
        else:
            shown = text.replace("/", " / ", 1) if self.r.random() < 0.1 and "/" in text else text
            self.program.lines.append(
                shown + self.r.choice(["", "", "", " $$ GOTO/1,2,3"]) * (not text.startswith("PPRINT"))
            )
        try:
            self.file.take(line, text)
        except RefusedError:
            self.program.fault = line
            raise

    def place(self) -> str:
        """Three coordinates."""
        return ",".join(number(self.r, -60, 60, 5).lstrip("+").replace(",", ".") for _ in range(3))

    def write(self) -> Program:
        """The whole file."""
        self.program.lines.append("UNITS/" + ("INCHES" if self.inch else "MM"))
        try:
            self.put("SPINDL/RPM,1200,CLW")
            self.put("FEDRAT/300,MMPM")
            self.put("RAPID")
            self.put(f"GOTO/{self.place()},0,0,1")
            for _ in range(self.r.randint(3, 20)):
                if self.spoilt and self.r.random() < 0.1:
                    self.spoil()
                self.one()
            self.put("FINI")
        except RefusedError:
            self.program.lines += ["GOTO/0,0,0", "FINI"]
        self.program.steps = self.file.steps
        return self.program

    def spoil(self) -> None:
        """A statement that must be refused."""
        text = self.r.choice(_BAD_APT)
        self.program.lines.append(text)
        self.program.fault = len(self.program.lines)
        raise RefusedError(text)

    def one(self) -> None:
        """One more thing."""
        r = self.r
        kind = r.choice(["goto", "goto", "axis", "rapid", "delta", "arc", "quiet", "feed", "drill", "dwell", "spindle"])
        if kind == "goto":
            self.put(f"GOTO/{self.place()}")
        elif kind == "axis":
            self.put(f"GOTO/{self.place()},{r.uniform(-1, 1):.6f},{r.uniform(-1, 1):.6f},{r.uniform(0.5, 1):.6f}")
        elif kind == "rapid":
            self.put("RAPID")
            self.put(f"GOTO/{self.place()}")
        elif kind == "delta":
            self.put(f"GODLTA/{self.place() if r.random() < 0.6 else f'{r.uniform(-5, 5):.4f}'}")
        elif kind == "arc":
            self.circle()
        elif kind == "quiet":
            self.put(r.choice(_QUIET_APT))
        elif kind == "feed":
            minute = r.randint(20, 900)
            feeds = (f"{minute},MMPM", f"MMPM,{minute}", "0.2,MMPR", f"{minute // 30 + 1},IPM")
            self.put(f"FEDRAT/{r.choice(feeds)}")
        elif kind == "spindle":
            self.put(f"SPINDL/{r.choice(['800,RPM,CLW', 'RPM,1500,CCLW', '900'])}")
        elif kind == "dwell":
            self.put(f"DELAY/{r.choice(['0.5', '2'])}")
        else:
            self.drill()

    def circle(self) -> None:
        """An arc in X Y about the tool's upright axis, as a CIRCLE and its end."""
        u = self.file.unit
        if self.file.here is None:
            return
        x, y, z = self.file.here
        radius, first = self.r.uniform(2, 40), self.r.uniform(0, 6.2)
        c = complex(x, y) - cmath.rect(radius, first)
        e = c + cmath.rect(radius, first + self.r.uniform(0.05, 6.2))
        up = self.r.choice([1, -1])
        stated = self.r.choice(["", f",{radius / u:.8f}"])
        self.put(f"CIRCLE/{c.real / u:.8f},{c.imag / u:.8f},{z / u:.8f},0,0,{up}{stated}")
        self.put(f"GOTO/{e.real / u:.8f},{e.imag / u:.8f},{z / u:.8f}")

    def drill(self) -> None:
        """A drill cycle and its holes."""
        words = [f"FEDTO,{self.r.choice(['', '-'])}{self.r.uniform(3, 20):.3f}", f"RAPTO,{self.r.uniform(0.5, 5):.3f}"]
        if self.r.random() < 0.6:
            words.append(f"RTRCTO,{self.r.uniform(5, 40):.3f}")
        if self.r.random() < 0.5:
            words.append("MMPM,150")
        deep = self.r.random() < 0.4
        if deep:
            words.append(f"STEP,{self.r.uniform(1, 5):.3f}")
        if self.r.random() < 0.3:
            words.append("DWELL,0.5")
        self.r.shuffle(words)
        self.put("CYCLE/DRILL," + ("DEEP," if deep else "") + ",".join(words))
        for _ in range(self.r.randint(1, 3)):
            self.put(f"GOTO/{self.place()}")
        self.put("CYCLE/OFF")


def compared(motions: Motions, steps: list[Step]) -> str:
    """What differs between what the project reads and the steps of the second interpreter; empty for nothing."""
    points, k = motions.points * 1e3, 0
    here = (0.0, 0.0, 0.0)
    for i, step in enumerate(steps):
        if k >= len(points):
            return f"step {i}, line {step.line}: no move"
        first, end = k, np.array(step.end)
        if step.sweep:
            k, wrong = _along(points, k, here, step)
            if wrong:
                return f"step {i}, line {step.line}: {wrong}"
        k += 1
        rows = slice(first, k)
        if np.abs(points[k - 1] - end).max() > SAME:
            return f"step {i}, line {step.line}: ends at {points[k - 1]}, not {end}"
        if step.line > 0 and set(motions.line[rows].tolist()) != {step.line}:
            return f"step {i}: line {motions.line[rows][0]}, not {step.line}"
        if (motions.rapid[rows] != (step.feed is None)).any():
            return f"step {i}, line {step.line}: rapid"
        feed = motions.feed[rows] * 6e4
        if step.feed is not None and not np.allclose(feed, step.feed, rtol=1e-6, equal_nan=True):
            return f"step {i}, line {step.line}: feed {feed[0]}, not {step.feed}"
        if np.abs(motions.axes[k - 1] - np.array(step.axis)).max() > 1e-6:
            return f"step {i}, line {step.line}: axis {motions.axes[k - 1]}, not {step.axis}"
        if abs(motions.dwell[k - 1] - step.dwell) > 1e-9:
            return f"step {i}, line {step.line}: rest {motions.dwell[k - 1]}, not {step.dwell}"
        here = step.end
    return f"{len(points) - k} moves too many" if k < len(points) else ""


def _along(points: np.ndarray, k: int, here: tuple[float, ...], step: Step) -> tuple[int, str]:
    """Last move of an arc that begins with move ``k``, and what is wrong with it; each of its points lies on it."""
    assert step.centre
    n, c = np.array(step.about), np.array(step.centre)
    last = np.array(here) - c
    rise = float((np.array(step.end) - c - last) @ n)
    start = float(last @ n)
    last = last - (last @ n) * n
    radius, swept = float(np.linalg.norm(last)), 0.0
    if not radius > 0.0:
        return k, "no radius"
    while k < len(points):
        lever = points[k] - c
        height = float(lever @ n) - start
        lever = lever - (lever @ n) * n
        swept += math.atan2(float(np.cross(last, lever) @ n), float(last @ lever))
        last = lever
        # Chords of a linear rise, ends that are rounded to a nanometre each.
        if abs(float(np.linalg.norm(lever)) - radius) > 1e-4 or abs(height - rise * swept / step.sweep) > 1e-4 * max(
            1.0, abs(rise)
        ):
            return k, f"off the arc by {np.linalg.norm(lever) - radius:.3g} mm"
        if abs(swept - step.sweep) < SWEPT:
            return k, ""
        if abs(swept) > abs(step.sweep) + SWEPT:
            break
        k += 1
    return k, f"sweeps {math.degrees(swept):.6g} deg, not {math.degrees(step.sweep):.6g}"


def judged(seed: int, language: str, folder: Path) -> tuple[str, str]:
    """One program: "equal", "refused" or "wrong", and what is wrong."""
    r = Random(seed)  # noqa: S311 - no secret
    program = (Writer if language == HEIDENHAIN else AptWriter)(r).write()
    file = folder / f"{language}.{'h' if language == HEIDENHAIN else 'apt'}"
    file.write_text("\n".join(program.lines) + "\n", encoding="utf-8")
    try:
        motions = read_toolpath(file, options=ReadOptions())
    except InputErrors as error:
        lines = sorted(int(str(e).split("line ", 1)[1].split(":", 1)[0]) for e in error.errors)
        if program.fault and lines[0] == program.fault:
            return "refused", ""
        return (
            "wrong",
            f"refused, and should be {'in line ' + str(program.fault) if program.fault else 'read'}: {error}",
        )
    if program.fault:
        return "wrong", f"read, and line {program.fault} must be refused: {program.lines[program.fault - 1]}"
    differs = compared(motions, program.steps)
    return ("wrong", differs) if differs else ("equal", "")


def trial(language: str, first: int, count: int) -> tuple[Counter[str], list[str]]:
    """Programs of seeds from ``first`` on: outcomes, and what is wrong with those that are."""
    outcomes, wrong = Counter[str](), []
    with tempfile.TemporaryDirectory() as name:
        for seed in range(first, first + count):
            outcome, what = judged(seed, language, Path(name))
            outcomes[outcome] += 1
            if what:
                wrong.append(f"{language}, seed {seed}: {what}")
    return outcomes, wrong


def main() -> int:
    """Run as many programs as asked."""
    a = asked(__doc__, programs=100000, seed=0, language=(HEIDENHAIN, APT), workers=2)
    languages = [a.language] if a.language else [HEIDENHAIN, APT]
    each, chunk = a.programs // len(languages), 500
    outcomes, wrong = Counter[str](), []
    with ProcessPoolExecutor(a.workers) as pool:
        runs = [
            pool.submit(trial, language, a.seed + k, min(chunk, each - k))
            for language in languages
            for k in range(0, each, chunk)
        ]
        for run in runs:
            some, faults = run.result()
            outcomes += some
            wrong += faults
    print("\n".join(wrong[:40]))
    equal, refused = outcomes["equal"], outcomes["refused"]
    print(f"{sum(outcomes.values())} programs: {equal} equal, {refused} refused by line, {outcomes['wrong']} wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    raise SystemExit(main())
