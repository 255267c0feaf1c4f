"""Blocks of random programs that all dialects of G-code share; :mod:`gcode_random` makes programs of them."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable

from plain_gcode import Interpreter


class Writer:
    """What all dialects have."""

    def __init__(self, chance: random.Random, dialect: str) -> None:
        self.chance, self.dialect = chance, dialect
        self.lines: list[str] = []
        self.subs: list[list[str]] = []
        self.one = Interpreter(dialect, {}, [0.0, 0.0, 0.0])
        self.small = chance.random() < 0.1
        self.numbered = chance.random() < 0.3
        self.last = ""

    def written(self) -> str:
        """The whole text."""
        self.head()
        wanted = self.chance.randint(5, 40)
        parts = self.parts()
        while len(self.lines) < wanted:
            self.chance.choices([p for p, _ in parts], [w for _, w in parts])[0]()
        self.emit("M30")
        return self.around()

    def head(self) -> None:
        """Modes and the first places."""
        self.emit(self.chance.choice(["G90 G17 G21 G94", "G21 G17 G90", "G17 G90 G94 G21 G40 G49 G80 G54"]))
        if self.chance.random() < 0.5:
            self.emit(self.chance.choice(["T1 M6", "S3000 M3", "M8", "T2 M6\nS500 M3"]))
        self.emit(f"G0 X{self.coordinate()} Y{self.coordinate()} Z{self.chance.choice([5, 10, 25.5])}")
        self.emit(f"G1 Z{self.chance.choice([0, -1, -2.5])} F{self.chance.choice([100, 250.5, 600, 1200])}")

    def around(self) -> str:
        """What stands around the blocks."""
        return "\n".join(self.lines) + "\n"

    def emit(self, text: str) -> None:
        """Write blocks, and do them."""
        for line in text.split("\n"):
            self.one.do(line)
            shown = line
            if self.chance.random() < 0.06:
                shown += self.chance.choice(self.remarks())
            if self.numbered and line:
                shown = f"N{10 * len(self.lines) + 10} {shown}"
            if self.chance.random() < 0.05 and not re.search(r"[=(;]|[A-Z]{2}", shown):
                shown = shown.replace(" ", "")
            self.lines.append(shown.lower() if self.small and "%" not in shown else shown)

    def remarks(self) -> list[str]:
        """Comments that may stand behind a block."""
        return [" (G91 X50)", " ; Z-5 M30", "(R2)"]

    def parts(self) -> list[tuple[Callable[[], None], int]]:
        """Constructs, and how often each comes."""
        return [
            (self.line, 10),
            (self.arc, 5),
            (self.circle, 1),
            (self.plane, 1),
            (self.mode, 2),
            (self.still, 2),
            (self.rapid, 1),
            (self.by_turn, 1),
        ]

    # Numbers and words

    def coordinate(self) -> str:
        """A coordinate, written in one of many ways."""
        value = self.chance.choice([self.chance.randint(-50, 50), round(self.chance.uniform(-50, 50), 3)])
        text = self.chance.choice([f"{value}", f"{value:.3f}", f"{value:+g}"])
        return text if "." in text or self.chance.random() < 0.5 else text + "."

    def exact(self, value: float) -> str:
        """A length mm in the unit of the program, to the nanometre."""
        return f"{value / self.one.unit:.7f}".rstrip("0").rstrip(".") or "0"

    def to(self, letter: str, value: float) -> str:
        """The word that leads an axis to a coordinate (mm in the frame in force)."""
        k = "XYZ".index(letter)
        scale = 2.0 if k == 0 and self.one.diameter else 1.0
        if self.one.absolute:
            return f"{letter}{self.exact(scale * value)}"
        return f"{letter}{self.exact(scale * (value - self.one.at[k]))}"

    def place(self) -> list[float]:
        """X and Y of a place, mm."""
        return [round(self.chance.uniform(-60, 60), self.chance.choice([0, 1, 3])) for _ in range(2)]

    def code(self, name: str) -> str:
        """A motion code, where it is not in force or by chance."""
        long = self.chance.choice([name, f"{name[0]}0{name[1:]}"])
        need = self.one.motion != name or self.chance.random() < 0.3
        return long + " " if need else ""

    def feed(self) -> str:
        """The word F where it is needed, or by chance."""
        need = math.isnan(self.one.feed)
        return f" F{self.chance.choice([50, 120.5, 400, 900, 2000])}" if need or self.chance.random() < 0.1 else ""

    # Constructs

    def line(self) -> None:
        """A straight move of one to three axes."""
        x, y = self.place()
        named = self.chance.choice(["X", "Y", "XY", "XY", "XY", "Z", "XZ", "XYZ"])
        target = {"X": x, "Y": y, "Z": round(self.chance.uniform(-10, 10), 2)}
        words = [self.to(a, target[a]) for a in named]
        self.emit(self.code("G1") + " ".join(words) + self.feed())

    def rapid(self) -> None:
        """A rapid move across."""
        x, y = self.place()
        self.emit(self.code("G0") + f"{self.to('X', x)} {self.to('Y', y)}")

    def _arc(self, full: bool, corner: str = "") -> None:
        u, v = self.one._flat
        here = self.one.at
        radius, a0 = self.chance.uniform(0.5, 40), self.chance.uniform(-math.pi, math.pi)
        offset = [round(-radius * math.cos(a0), 3), round(-radius * math.sin(a0), 3)]
        centre = list(here)
        centre[u] += offset[0]
        centre[v] += offset[1]
        sense = self.chance.choice([1, -1])
        turn = 2 * math.pi if full else self.chance.uniform(0.1, 6.0)
        c, s = math.cos(sense * turn), math.sin(sense * turn)
        end = list(here)
        end[u] = centre[u] + c * -offset[0] - s * -offset[1]
        end[v] = centre[v] + s * -offset[0] + c * -offset[1]
        w = self.one.normal
        letters = ["XYZ"[u], "XYZ"[v]]
        words = (
            []
            if full and self.chance.random() < 0.5
            else [self.to(a, here[k] if full else end[k]) for a, k in zip(letters, (u, v), strict=True)]
        )
        if self.chance.random() < 0.2 and not corner:
            words.append(self.to("XYZ"[w], here[w] + round(self.chance.uniform(-5, 5), 2)))
            if full and len(words) < 3:
                words = [*(self.to(a, here[k]) for a, k in zip(letters, (u, v), strict=True)), words[-1]]
        near = abs(turn - math.pi) < 0.05 or turn > 6.0 or turn < 0.2
        if not full and not near and self.chance.random() < 0.3:
            r = math.hypot(*offset)
            words.append(self.radius(r if turn < math.pi else -r))
        else:
            words += self.offsets(u, v, offset, centre)
        self.emit(self.code("G2" if sense < 0 else "G3") + " ".join([*words, corner]).strip() + self.feed())

    def radius(self, r: float) -> str:
        """The word of a radius."""
        return f"R{self.exact(r)}"

    def offsets(self, u: int, v: int, offset: list[float], centre: list[float]) -> list[str]:
        """The words of a centre."""
        if self.one.centre_absolute:
            return [f"{'IJK'[u]}{self.exact(centre[u])}", f"{'IJK'[v]}{self.exact(centre[v])}"]
        some = [
            f"{'IJK'[k]}{self.exact(o)}" for k, o in ((u, offset[0]), (v, offset[1])) if o or self.chance.random() < 0.5
        ]
        return some or [f"{'IJK'[u]}0"]

    def arc(self) -> None:
        """A part of a circle, or a helix."""
        self._arc(False)

    def circle(self) -> None:
        """A full circle."""
        self._arc(True)

    def by_turn(self) -> None:
        """Feed per turn of the spindle."""
        self.emit(f"S{self.chance.choice([800, 2500])} M3")
        self.emit(f"G95 F{self.chance.choice([0.05, 0.2])}")
        for _ in range(self.chance.randint(1, 3)):
            x, y = self.place()
            self.emit(f"{self.code('G1')}{self.to('X', x)} {self.to('Y', y)}")
        self.emit(f"G94 F{self.chance.choice([200, 800])}")

    def plane(self) -> None:
        """Another plane."""
        if not self.one.frame.angle and not self.one.diameter:
            self.emit(self.chance.choice(["G17", "G18", "G19", "G17"]))

    def mode(self) -> None:
        """Coordinates or increments."""
        self.emit(self.chance.choice(["G90", "G91"]))

    def still(self) -> None:
        """A block that does not move."""
        self.emit(
            self.chance.choice(["M8", "M9", "G4 P1", "G4 P0.5", "S2000 M3", "M5", "T3", "", "M1", "G40", "G54", "M0"])
        )


class Iso(Writer):
    """What Fanuc and LinuxCNC share."""

    def parts(self) -> list[tuple[Callable[[], None], int]]:
        """Constructs, and how often each comes."""
        return [*super().parts(), (self.units, 1), (self.holes, 1), (self.call, 1), (self.frame, 2), (self.by_time, 1)]

    def units(self) -> None:
        """Another unit."""
        self.emit(self.chance.choice(["G20", "G21"]))

    def by_time(self) -> None:
        """Feed by the time of a block, which each has its own word for."""
        self.emit("G93")
        for _ in range(self.chance.randint(1, 3)):
            x, y = self.place()
            self.emit(f"{self.code('G1')}{self.to('X', x)} {self.to('Y', y)} F{self.chance.choice([2, 7.5, 30])}")
        self.emit(f"G94 F{self.chance.choice([200, 800])}")

    def holes(self) -> None:
        """A few holes from above."""
        if self.one.normal != 2:
            self.emit("G17")
        if not self.one.absolute:
            self.emit("G90")
        top = math.ceil(max(self.one.at[2], 0.0)) + self.chance.choice([2, 5])
        r = top - self.chance.choice([0, 1, 1.5])
        self.emit(f"G0 {self.to('Z', top)}")
        x, y = self.place()
        cycle = self.chance.choice(["G81", "G82", "G83"])
        words = f"{self.to('Z', r - self.chance.choice([3, 7.5]))} R{self.exact(r)}"
        words += {"G81": "", "G82": " P0.5", "G83": f" Q{self.exact(2)}"}[cycle]
        feed = f" F{self.chance.choice([80, 100.5])}" if math.isnan(self.one.feed) or self.chance.random() < 0.5 else ""
        back = self.chance.choice(["G98 ", "G99 "] + [""] * (self.one.initial_back is not None))
        self.emit(f"{back}{cycle} {self.to('X', x)} {self.to('Y', y)} {words}{feed}")
        for _ in range(self.chance.randint(0, 3)):
            x, y = self.place()
            self.emit(
                self.chance.choice([f"X{self.exact(x)}", f"Y{self.exact(y)}", f"X{self.exact(x)} Y{self.exact(y)}"])
            )
        self.emit("G80")

    def call(self) -> None:
        """Call a subprogram with small steps added."""
        if self.one.centre_absolute or self.one.normal != 2:
            return
        absolute = self.one.absolute
        number = self.chance.randint(1000, 8999)
        body = ["G91"]
        for _ in range(self.chance.randint(1, 3)):
            body.append(f"G1 X{self.chance.randint(-9, 9)} Y{self.chance.randint(-9, 9)}")
        if self.chance.random() < 0.4:
            body.append("G3 X2 Y0 I1 J0")
        body.append("G90" if absolute or self.chance.random() < 0.5 else "G91")
        body.append("M99")
        if self.subs and self.chance.random() < 0.3:
            # One within another; what it leaves in force is done before this one's own steps.
            body.insert(1, f"M98 P{self.subs[-1][0][1:]}\nG91")
        self.subs.append([f"O{number}", *"\n".join(body).split("\n")])
        self.one.subs[str(number)] = self.subs[-1][1:]
        times = self.chance.choice([1, 1, 2, 3])
        if math.isnan(self.one.feed):
            self.emit("F300")
        self.emit(self.calling(number, times))

    def calling(self, number: int, times: int) -> str:
        """The block that calls a subprogram."""
        return f"M98 P{number}" + (f" L{times}" if times > 1 else "")

    def around(self) -> str:
        """What stands around the blocks."""
        subs = ["\n".join(one) for one in self.subs]
        return "\n".join([*self.lines, *subs]) + "\n"

    def frame(self) -> None:
        """Another origin."""
        if self.one.family in ("", "G92") and not self.one.frame.angle and self.chance.random() < 0.5:
            x, y = self.place()
            self.emit(self.chance.choice([f"G92 X{self.exact(x)}", f"G92 X{self.exact(x)} Y{self.exact(y)}", "G92 Z0"]))
        elif self.one.family in ("", "G52"):
            x, y = self.place()
            self.emit(
                self.chance.choice([f"G52 X{self.exact(x)} Y{self.exact(y)}", f"G52 Y{self.exact(y)}", "G52 X0 Y0 Z0"])
            )


class Fanuc(Iso):
    """G68, corners, counts before a subprogram's number."""

    def parts(self) -> list[tuple[Callable[[], None], int]]:
        """Constructs, and how often each comes."""
        return [*super().parts(), (self.turned, 2), (self.cornered, 3)]

    def around(self) -> str:
        """What stands around the blocks."""
        text = super().around()
        return f"%\nO1\n{text}%\n" if self.chance.random() < 0.5 or self.subs else text

    def calling(self, number: int, times: int) -> str:
        """The block that calls a subprogram."""
        return f"M98 P{times}{number}" if times > 1 and self.chance.random() < 0.5 else super().calling(number, times)

    def frame(self) -> None:
        """Another origin."""
        if not self.one.frame.angle:
            super().frame()

    def turned(self) -> None:
        """Turn the coordinates, or turn them back; both coordinates are given next."""
        if self.one.frame.angle:
            self.emit("G69")
        elif self.one.frame.shift == (0.0, 0.0, 0.0):
            if self.one.normal != 2:
                self.emit("G17")
            if not self.one.absolute:
                self.emit("G90")
            x, y = self.place()
            self.emit(f"G68 X{self.exact(x)} Y{self.exact(y)} R{self.chance.choice([90, -30, 45, 12.5])}")
        x, y = self.place()
        if self.one.absolute:
            self.emit(self.code("G1") + f"{self.to('X', x)} {self.to('Y', y)}{self.feed()}")

    def corner(self) -> str:
        """The word of a corner."""
        return self.chance.choice([",R", ",R", ",C"]) + self.exact(self.chance.choice([0.5, 1, 2.5]))

    def rounding(self) -> str:
        """The word of a round corner."""
        return self.corner().replace(",C", ",R").replace("CHR", "RND").replace("CHF", "RND")

    def cornered(self) -> None:
        """Long sides with corners between them, and at times an arc behind the last."""
        if self.one.normal != 2:
            self.emit("G17")
        for _ in range(self.chance.randint(1, 3)):
            self.side(self.corner())
        if self.one.absolute and self.chance.random() < 0.3:
            # Beside an arc a corner is round.
            self.side(self.rounding())
            for _ in range(self.chance.randint(0, 2)):
                self._arc(False, self.rounding())
            if self.chance.random() < 0.5:
                self._arc(False)
            else:
                self.side("")
        else:
            self.side("")

    def side(self, word: str) -> None:
        """A side of 15 to 60 mm."""
        here, a, size = self.one.at, self.chance.uniform(-math.pi, math.pi), self.chance.uniform(15, 60)
        x, y = here[0] + round(size * math.cos(a), 3), here[1] + round(size * math.sin(a), 3)
        self.emit(" ".join(f"{self.code('G1')}{self.to('X', x)} {self.to('Y', y)} {word}{self.feed()}".split()))


class LinuxCnc(Iso):
    """The variants of G92, absolute centres, and turns of an arc."""

    def parts(self) -> list[tuple[Callable[[], None], int]]:
        """Constructs, and how often each comes."""
        return [*super().parts(), (self.centres, 1)]

    def centres(self) -> None:
        """How centres are written."""
        self.emit(self.chance.choice(["G90.1", "G91.1"]))

    def frame(self) -> None:
        """Another origin."""
        if self.one.family == "G92" and self.chance.random() < 0.6:
            self.emit(self.chance.choice(["G92.1", "G92.2", "G92.3", "G92.2", "G92.3"]))
        else:
            super().frame()

    def offsets(self, u: int, v: int, offset: list[float], centre: list[float]) -> list[str]:
        """The words of a centre."""
        words = super().offsets(u, v, offset, centre)
        return [*words, "P2"] if self.chance.random() < 0.1 else words
