"""Blocks of random Sinumerik programs."""

from __future__ import annotations

import math
from collections.abc import Callable

from gcode_writer import Fanuc, Writer


class Siemens(Fanuc):
    """Corners by name, polar words, frames of the program, diameters, subprograms with P."""

    def head(self) -> None:
        """Modes and the first places."""
        self.emit(self.chance.choice(["G90 G17 G71 G94", "G17 G90 G54 G71", "G90 G71 G17 G40 G94"]))
        self.emit(self.chance.choice(["T1 M6", "S3000 M3", "M8", "T2 D1", "G64", "G642"]))
        self.emit(f"G0 X{self.coordinate()} Y{self.coordinate()} Z{self.chance.choice([5, 10, 25.5])}")
        self.emit(f"G1 Z{self.chance.choice([0, -1, -2.5])} F{self.chance.choice([100, 250.5, 600, 1200])}")

    def parts(self) -> list[tuple[Callable[[], None], int]]:
        """Constructs, and how often each comes."""
        return [
            *Writer.parts(self),
            (self.cornered, 3),
            (self.modal, 1),
            (self.polar, 2),
            (self.angle, 1),
            (self.own, 2),
            (self.programmable, 2),
            (self.diameters, 1),
            (self.call, 1),
            (self.blending, 1),
            (self.through, 1),
            (self.tangent, 1),
            (self.opening, 1),
            (self.drilled, 1),
        ]

    def remarks(self) -> list[str]:
        """Comments that may stand behind a block."""
        return [" ; Z-5 M30", " ;(G91 X50)"]

    def still(self) -> None:
        """A block that does not move."""
        self.emit(self.chance.choice(["M8", "M9", "G4 F1", "S2000 M3", "M5", "T3", "", "M1", "G40", "G54", "M0", "D1"]))

    def around(self) -> str:
        """What stands around the blocks."""
        text = "\n".join(self.lines) + "\n"
        if not self.subs:
            return text
        return "%_N_PART_MPF\n" + text + "".join(f"%_N_{one[0]}_SPF\n" + "\n".join(one[1:]) + "\n" for one in self.subs)

    def radius(self, r: float) -> str:
        """The word of a radius."""
        return f"CR={self.exact(r)}"

    def offsets(self, u: int, v: int, offset: list[float], centre: list[float]) -> list[str]:
        """The words of a centre."""
        if self.chance.random() < 0.2:
            return [f"{'IJK'[u]}=AC({self.exact(centre[u])})", f"{'IJK'[v]}=AC({self.exact(centre[v])})"]
        return super().offsets(u, v, offset, centre)

    def corner(self) -> str:
        """The word of a corner."""
        word = self.chance.choice(["RND=", "CHF=", "CHR="]) + self.exact(self.chance.choice([0.5, 1, 2.5]))
        return word + " FRC=75" * (self.chance.random() < 0.15)

    def _arc(self, full: bool, corner: str = "") -> None:
        if not self.one.diameter:
            super()._arc(full, corner)

    def through(self) -> None:
        """An arc by way of a point."""
        self.flat()
        if not self.one.absolute:
            self.emit("G90")
        here, a, b = self.one.at, self.chance.uniform(0.5, 3), self.chance.uniform(3.5, 5.5)
        r, a0, sense = self.chance.uniform(5, 40), self.chance.uniform(-math.pi, math.pi), self.chance.choice([1, -1])
        centre = here[0] - r * math.cos(a0), here[1] - r * math.sin(a0)
        (u, v), (x, y) = (
            (centre[0] + r * math.cos(a0 + sense * t), centre[1] + r * math.sin(a0 + sense * t)) for t in (a, b)
        )
        self.emit(f"CIP {self.to('X', x)} {self.to('Y', y)} I1={self.exact(u)} J1={self.exact(v)}{self.feed()}")
        self.emit("G1")

    def tangent(self) -> None:
        """An arc that goes on from a side."""
        self.flat()
        if not self.one.absolute:
            self.emit("G90")
        self.side("")
        x, y = self.place()
        if math.dist((x, y), self.one.at[:2]) > 5:
            self.emit(f"CT {self.to('X', x)} {self.to('Y', y)}")
            self.emit("G1")

    def opening(self) -> None:
        """An arc by its opening angle, with its centre or its end."""
        self.flat()
        code, angle = self.chance.choice(["G2", "G3"]), self.chance.choice([30, 90, 150, 200, 275.5])
        x, y = self.place()
        if self.chance.random() < 0.5:
            if math.dist((x, y), self.one.at[:2]) > 5:
                self.emit(f"{code} {self.to('X', x)} {self.to('Y', y)} AR={angle}{self.feed()}")
        else:
            self.emit(f"{code} I{self.exact(x)} J{self.exact(y + 0.5)} AR={angle}{self.feed()}")

    def drilled(self) -> None:
        """Holes by a cycle, at once or at places to come."""
        self.flat()
        if not self.one.absolute:
            self.emit("G90")
        top = math.ceil(max(self.one.at[2], 0.0)) + self.chance.choice([2, 5])
        self.emit(f"G0 {self.to('Z', top)}")
        if math.isnan(self.one.feed):
            self.emit("F150")
        safe, depth = self.chance.choice([0.5, 1, 2]), self.chance.choice([3, 7.5])
        bottom = top - 3 - depth
        heights = self.chance.choice(
            [
                f"81({top},{top - 3},{safe},{bottom})",
                f"81({top},{top - 3},{safe},,{depth})",
                f"82({top},{top - 3},{safe},{bottom},,1)",
            ]
        )
        cycle = f"CYCLE{heights}"
        if self.chance.random() < 0.3:
            self.emit(cycle)
            return
        self.emit(f"MCALL {cycle}")
        for _ in range(self.chance.randint(1, 3)):
            x, y = self.place()
            self.emit(f"{self.code('G0')}{self.to('X', x)} {self.to('Y', y)}")
        self.emit("MCALL")

    def flat(self) -> None:
        """Constructs in XY begin in that plane, and with radii."""
        if self.one.diameter:
            self.emit("DIAMOF")
        if self.one.normal != 2:
            self.emit("G17")

    def cornered(self) -> None:
        """Long sides with corners between them."""
        self.flat()
        super().cornered()

    def modal(self) -> None:
        """A contour whose corners are all rounded."""
        self.flat()
        self.side(f"RNDM={self.chance.choice([1, 2])}")
        for _ in range(self.chance.randint(1, 3)):
            self.side("")
        self.side("RNDM=0")

    def polar(self) -> None:
        """A pole, and moves about it."""
        self.flat()
        x, y = self.place()
        pole = self.chance.choice(["G110", "G111", "G112", "G111"])
        self.emit(f"{pole} X{self.exact(x)} Y{self.exact(y)}")
        if math.dist(self.one.at[:2], self.one.pole) < 1:
            return
        self.emit(
            f"{self.code('G1')}AP={self.chance.randint(0, 359)} RP={self.chance.choice([10, 25.5, 40])}{self.feed()}"
        )
        for _ in range(self.chance.randint(0, 3)):
            ap = f"AP=IC({self.chance.choice([15, -40, 90])})"
            self.emit(
                self.chance.choice(
                    [
                        f"G1 {ap}",
                        f"G1 RP={self.chance.choice([5, 30])}",
                        f"G3 {ap}",
                        f"G2 {ap}",
                        f"G1 AP={self.chance.randint(-90, 200)} RP=20",
                    ]
                )
            )

    def angle(self) -> None:
        """A move by its angle and one coordinate."""
        self.flat()
        here = self.one.at
        a, size = self.chance.choice([30, 45, 120, -60, 200, 271]), self.chance.uniform(5, 40)
        k = self.chance.choice([0, 1])
        far = here[k] + round(size * (math.cos if k == 0 else math.sin)(math.radians(a)), 3)
        self.emit(f"{self.code('G1')}ANG={a} {self.to('XY'[k], far)}{self.feed()}")

    def own(self) -> None:
        """Coordinates that say themselves how they are meant."""
        x, y = self.place()
        self.emit(
            self.code("G1")
            + self.chance.choice(
                [
                    f"X=IC({self.exact(x)}) Y=AC({self.exact(y)})",
                    f"X=AC({self.exact(x)})",
                    f"Y=IC({self.exact(y)})",
                    f"X={self.exact(x)} Y={self.exact(y)}",
                ]
            )
            + self.feed()
        )

    def programmable(self) -> None:
        """Another frame."""
        self.flat()
        x, y = self.place()
        a = self.chance.choice([30, 90, -45])
        self.emit(
            self.chance.choice(
                [
                    f"TRANS X{self.exact(x)} Y{self.exact(y)}",
                    f"ATRANS X{self.exact(x)}",
                    f"TRANS Z{x / 10:g}",
                    f"ROT RPL={a}",
                    f"AROT RPL={a}",
                    "TRANS",
                    "ROT",
                ]
            )
        )
        x, y = self.place()
        self.emit(f"G1 X=AC({self.exact(x)}) Y=AC({self.exact(y)}){self.feed()}")

    def diameters(self) -> None:
        """X as a diameter, or not."""
        if not self.one.frame.angle:
            self.emit(self.chance.choice(["DIAMON", "DIAMOF"]))

    def blending(self) -> None:
        """A line where the control may blend."""
        self.emit("G64 ADIS=0.05")
        self.line()

    def call(self) -> None:
        """Call a subprogram with small steps."""
        if self.one.diameter or self.one.normal != 2:
            return
        name = f"L{self.chance.randint(100, 999)}"
        body = ["G91"]
        for _ in range(self.chance.randint(1, 3)):
            body.append(f"G1 X{self.chance.randint(-9, 9)} Y{self.chance.randint(-9, 9)}")
        body.append("G90" if self.one.absolute else "G91")
        body.append(self.chance.choice(["M17", "RET"]))
        self.subs.append([name, *body])
        self.one.subs[name] = body
        times = self.chance.choice([1, 2, 3])
        self.emit(name + (f" P{times}" if times > 1 else ""))
