"""The kinds of parameters that an arm can have. A new one: its line in ``KINDS``, and a class if none here fits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.effects.base import EffectParameter, PlacedEffect
from fem.effects.frames import TURNED_FRAME
from fem.free.base import SHIFT, TURN, Figure, Flexibility, Given, Kind, Parameter, Scale, Tables
from fem.model import ArmModel, LinkPart
from fem.springs import RIGID, SumSpring
from fem.statics.ports import BASE, ROWS, TOOL, Port
from robots import InputError, ModelDescription
from robots.arrays import Array
from robots.schema.units import dimension_of, factor

AXES = ("x", "y", "z")
# Units of a compliance's entries, by how many of its two rows are turns.
ENTRY_UNITS = ("m/N", "rad/N", "rad/(N m)")
# Tables of a link that have a wall: they get thicker together.
WALLS = ("section", "section_end", "rim")
# An effect's number is searched so many times beyond its plausible size.
BEYOND = 10.0
# Usual ranges of numbers other than joint springs (assumed). A stiffness that the model has is varied by this factor to
# either side, a link by its share; one that the model holds rigid over magnitudes of the field, N m/rad and N/m.
FACTOR, SHARE = math.sqrt(10.0), 1.1
TILTS, BASE_TILTS, SHIFTS = (5e5, 5e6), (1e7, 1e8), (1e8, 1e9)


@dataclass(frozen=True)
class _Entry(Kind):
    """An entry of the compliance of the base, a joint, the tool or the bar; one row or two."""

    def changed(self, p: Parameter, v: float, model: ArmModel, walls: Mapping[str, Flexibility]) -> ArmModel:
        if p.place == "bar":
            return model if model.bar is None else replace(model, bar=replace(model.bar, compliance=v))
        a, b = p.index[0], p.index[-1]
        if p.place == BASE:
            return replace(model, base=_with(model.base, a, b, v))
        if p.place == TOOL:
            return replace(model, tool=_with(model.tool, a, b, v))
        if (a, b) == (5, 5):
            return model.with_joint(p.place, axial=SumSpring(RIGID, v))
        bearing = model.joints[model.robot.joint_names.index(p.place)].bearing
        return model.with_joint(p.place, bearing=_with(bearing, a, b, v))

    def at_port(
        self, p: Parameter, v: Array, port: Port, model: ArmModel, q: Array, walls: Mapping[str, Flexibility]
    ) -> tuple[Array, Array]:
        a, b = p.index[0], p.index[-1]
        J = port.influence(a, b)
        return (v - own_compliance(model, p.place, a, b, q))[:, None] * J, J


@dataclass(frozen=True)
class _Stiffness(_Entry):
    """A stiffness along or about one axis of a place, or along the bar."""

    def made(self, model: ArmModel, place: str, what: str) -> Parameter | None:
        if place == "bar" and what == "stiffness" and model.bar is not None and model.bar.compliance > 0.0:
            return Parameter("", self, place, (0,), "N/m", 1.0 / model.bar.compliance, *SHIFT, "compliance")
        name = "rz" if what == "stiffness" and place in model.robot.joint_names else what
        if place not in _places(model) or name not in ROWS:
            return None
        row = ROWS.index(name)
        _refuse_law(model, place, row)
        compliance = float(np.max(own_compliance(model, place, row, row, np.zeros((1, model.robot.dof)))))
        unit, span = ("N/m", SHIFT) if row < 3 else ("N m/rad", TURN)
        value = 1.0 / compliance if compliance > 0.0 else np.inf
        return Parameter("", self, place, (row,), unit, value, *span, "compliance")

    def known(self, model: ArmModel) -> Iterator[str]:
        rows = "|".join(ROWS)
        yield f"{{{','.join(model.robot.joint_names)}}}.stiffness"
        yield f"{{{','.join(_places(model))}}}.{{{rows}}}, two rows joined by '-' for an entry off the diagonal"
        if model.bar is not None and model.bar.compliance > 0.0:
            yield "bar.stiffness"

    def spring_of(self, p: Parameter) -> str | None:
        return p.place if p.index == (5,) and p.place not in (BASE, TOOL) else None

    def check(self, p: Parameter, among: Sequence[Parameter], given: Given) -> None:
        if (p.place, p.index[0]) in given.laws:
            raise InputError(f"parameter {p.name}", code="M001", value="a constant and a law", allowed="one of them")

    def screened(self, p: Parameter, springs: tuple[float, float]) -> tuple[float, float]:
        if p.spring_of is not None:
            return springs
        if math.isfinite(p.value):
            return p.value / FACTOR, p.value * FACTOR
        if p.unit == "N/m":
            return SHIFTS
        return BASE_TILTS if p.place == BASE else TILTS

    def put(self, p: Parameter, value: float, tables: Tables, figure: Figure) -> None:
        if p.place == "bar":
            tables.data["parallelogram"]["bar_stiffness"] = figure(value, p.unit)
        elif p.spring_of is not None:
            tables.of("joint", p.place)["stiffness"] = figure(value, p.unit)
        else:
            tables.place(p.place)[ROWS[p.index[0]]] = figure(value, p.unit)


@dataclass(frozen=True)
class _Coupling(_Entry):
    """An entry of a place's compliance off the diagonal."""

    def made(self, model: ArmModel, place: str, what: str) -> Parameter | None:
        pair = what.split("-")
        if place not in _places(model) or len(pair) != 2 or pair[0] == pair[1] or not set(pair) <= set(ROWS):
            return None
        a, b = sorted(ROWS.index(r) for r in pair)
        # An entry off the diagonal is below the geometric mean of its two entries on it.
        most = float(np.sqrt(_softest(a) * _softest(b)))
        own = own_compliance(model, place, a, b, np.zeros((1, model.robot.dof)))
        unit = ENTRY_UNITS[int(a >= 3) + int(b >= 3)]
        return Parameter("", self, place, (a, b), unit, float(own[0]), -most, most, "linear")

    def put(self, p: Parameter, value: float, tables: Tables, figure: Figure) -> None:
        place, rows = tables.place(p.place), tuple(ROWS[k] for k in p.index)
        place["entry"] = [one for one in place["entry"] if set(one["rows"]) != set(rows)]
        place["entry"].append({"rows": rows, "compliance": figure(value, p.unit)})


@dataclass(frozen=True)
class _OfLink(Kind):
    """What one number changes of a link."""

    def made(self, model: ArmModel, place: str, what: str) -> Parameter | None:
        link = next((link for link in model.links if link.name == place), None)
        return self.of_link(link) if link is not None and what == self.name else None

    def of_link(self, link: LinkPart) -> Parameter:
        raise NotImplementedError

    def known(self, model: ArmModel) -> Iterator[str]:
        if model.links:
            yield f"{{{','.join(link.name for link in model.links)}}}.{self.name}"

    def screened(self, p: Parameter, springs: tuple[float, float]) -> tuple[float, float]:
        return p.value / SHARE, p.value * SHARE


@dataclass(frozen=True)
class _Modulus(_OfLink):
    """The elastic modulus of a link."""

    def of_link(self, link: LinkPart) -> Parameter:
        E = link.mesh.youngs_modulus
        return Parameter("", self, link.name, (), "Pa", E, 0.1 * E, 10.0 * E, "compliance")

    def changed(self, p: Parameter, v: float, model: ArmModel, walls: Mapping[str, Flexibility]) -> ArmModel:
        own = next(link for link in model.links if link.name == p.place).element.flexibility
        return _with_link(model, p.place, p.value * v * own)

    def at_port(
        self, p: Parameter, v: Array, port: Port, model: ArmModel, q: Array, walls: Mapping[str, Flexibility]
    ) -> tuple[Array, Array]:
        J = p.value * _share(port)
        return np.reshape(v - 1.0 / p.value, (-1, 1)) * J, J

    def put(self, p: Parameter, value: float, tables: Tables, figure: Figure) -> None:
        tables.of("link", p.place)["youngs_modulus"] = figure(value, p.unit)


@dataclass(frozen=True)
class _Wall(_OfLink):
    """The walls of a link, all by one factor."""

    def of_link(self, link: LinkPart) -> Parameter:
        t = float(link.mesh.dimensions[0, 0, -1])
        return Parameter("", self, link.name, (), "m", t, t / 2.0, t * 2.0, "log")

    def check(self, p: Parameter, among: Sequence[Parameter], given: Given) -> None:
        if p.place not in given.walls:
            raise InputError(
                f"parameter {p.name}", code="M001", value="no sections to vary", allowed="a link with a section"
            )
        other = next((x for x in among if isinstance(x.kind, _Modulus) and x.place == p.place), None)
        if other is not None:
            raise InputError(
                f"parameters {p.name} and {other.name}",
                code="M001",
                value="both free",
                allowed="one of them: readings only see their product",
            )

    def changed(self, p: Parameter, v: float, model: ArmModel, walls: Mapping[str, Flexibility]) -> ArmModel:
        return _with_link(model, p.place, walls[p.place](p.outer(v))[0])

    def at_port(
        self, p: Parameter, v: Array, port: Port, model: ArmModel, q: Array, walls: Mapping[str, Flexibility]
    ) -> tuple[Array, Array]:
        F, dF = walls[p.place](p.outer(float(v)))
        # The serial load path leaves the lever's pin, the last six rows, without load.
        s = len(port.distinct)
        return port.share(F[:s, :s]) - _share(port), port.share(dF[:s, :s])

    def put(self, p: Parameter, value: float, tables: Tables, figure: Figure) -> None:
        link = tables.of("link", p.place)
        for key in WALLS:
            if link.get(key) is not None:
                wall = link[key]["wall"]
                link[key]["wall"] = figure(wall["value"] * value / p.value, wall["unit"])


@dataclass(frozen=True)
class _Shift(Kind):
    """What moves the loaded poses or turns the joints' zeros, counted from where the model has them.

    ``PLACE.NAME`` of the ``names``, searched up to ``most`` either way, as a rule within ``usual``; ``triples``: table
    and key in a model file, empty for the points of readings, which the tables know.
    """

    place: str = ""
    names: tuple[str, ...] = AXES
    unit: str = "m"
    most: float = 0.0
    usual: float = 0.0
    triples: tuple[tuple[str, str], ...] = ()

    def made(self, model: ArmModel, place: str, what: str) -> Parameter | None:
        if place != self.place or what not in self.names:
            return None
        return self._made(place, self.names.index(what))

    def _made(self, place: str, index: int) -> Parameter:
        return Parameter("", self, place, (index,), self.unit, 0.0, -self.most, self.most, "linear")

    def known(self, model: ArmModel) -> Iterator[str]:
        yield f"{self.place}.{{{'|'.join(self.names)}}}"

    def screened(self, p: Parameter, springs: tuple[float, float]) -> tuple[float, float]:
        return p.value - self.usual, p.value + self.usual

    def put(self, p: Parameter, value: float, tables: Tables, figure: Figure) -> None:
        for table, key in self.triples or tables.points:
            tables.shift(table, key, p.index[0], p.name, figure(value, self.unit))


@dataclass(frozen=True)
class _Zero(_Shift):
    """The zero error of a joint."""

    def made(self, model: ArmModel, place: str, what: str) -> Parameter | None:
        joints = model.robot.joint_names
        return self._made(place, joints.index(place)) if place in joints and what == self.name else None

    def known(self, model: ArmModel) -> Iterator[str]:
        yield f"{{{','.join(model.robot.joint_names)}}}.{self.name}"

    def variable(self, p: Parameter, description: ModelDescription) -> float | None:
        """The whole zero error: the model's robot has it in its frames already."""
        error = description.joint[p.index[0]].zero_error
        return 0.0 if error is None else error.si

    def put(self, p: Parameter, value: float, tables: Tables, figure: Figure) -> None:
        joint = tables.of("joint", p.place)
        old = joint.get("zero_error")
        before = 0.0 if old is None else old["value"] * factor("angle", old["unit"])
        joint["zero_error"] = figure(float(np.degrees(value + before)), "deg")


@dataclass(frozen=True)
class _Frame(_Shift):
    """A turn of the frame in which forces and displacements are stated; in a file it is an effect."""

    def put(self, p: Parameter, value: float, tables: Tables, figure: Figure) -> None:
        name, code = TURNED_FRAME.parameters[p.index[0]].name, TURNED_FRAME.code
        table = next((one for one in tables.data["effect"] if one["code"] == code), None)
        if table is None:
            table = {"code": code, "parameters": {}, "note": TURNED_FRAME.words}
            tables.data["effect"] = (*tables.data["effect"], table)
        old = table["parameters"].get(name)
        before = 0.0 if old is None else old["value"] * factor("angle", old["unit"])
        table["parameters"] = {**table["parameters"], name: figure(float(np.degrees(value + before)), "deg")}


@dataclass(frozen=True)
class _Law(Kind):
    """A coefficient of ln(stiffness) of a joint over angles; laws are put into a model and written whole."""

    def screened(self, p: Parameter, springs: tuple[float, float]) -> tuple[float, float]:
        low, high = np.log(springs) if p.prior is None else (-p.prior[1], p.prior[1])
        return float(low), float(high)


@dataclass(frozen=True)
class _OfEffect(Kind):
    """A number of an effect that the arm has; effects take theirs by themselves."""

    def check(self, p: Parameter, among: Sequence[Parameter], given: Given) -> None:
        if p.place not in given.codes:
            raise InputError(
                "parameter",
                code="M001",
                value=p.name,
                allowed=f"effects here: {', '.join(sorted(given.codes)) or 'none'}",
            )

    def put(self, p: Parameter, value: float, tables: Tables, figure: Figure) -> None:
        # In the unit that the file has it in.
        name = p.name.rpartition(".")[2]
        table = next(one for one in tables.data["effect"] if one["code"] == p.place)
        old = table["parameters"].get(name)
        unit = p.unit if old is None else old["unit"]
        table["parameters"] = {**table["parameters"], name: figure(value / factor(dimension_of(unit), unit), unit)}


LAW, OF_EFFECT = _Law("law", of_law=True), _OfEffect("effect", of_effect=True)
KINDS: tuple[Kind, ...] = (
    _Stiffness("stiffness", is_linear=True),
    _Coupling("coupling", is_linear=True),
    _Zero("zero", shifts="zero", unit="rad", most=math.radians(5.0), usual=math.radians(1.0)),
    # Where the load acts, from the read point, in flange axes; by what its direction is off, about the base's axes.
    _Shift("load", shifts="load", place="load", most=0.2, usual=0.03, triples=(("load", "offset"),)),
    _Shift(
        "tilt",
        shifts="tilt",
        place="load",
        names=("tilt_x", "tilt_y", "tilt_z"),
        unit="rad",
        most=math.radians(10.0),
        usual=math.radians(3.0),
        triples=(("load", "tilt"),),
    ),
    # Where the read and loaded point is, in flange axes.
    _Shift("point", shifts="point", place="point", most=0.5, usual=0.03),
    # By what the table's axes are turned, about the base's.
    _Frame(
        "frame",
        shifts="frame",
        place="frame",
        names=("rx", "ry", "rz"),
        unit="rad",
        most=math.radians(30.0),
        usual=math.radians(3.0),
    ),
    _Modulus("modulus", is_linear=True),
    _Wall("wall", has_sections=True),
    LAW,
    OF_EFFECT,
)


def of_effect(effects: Sequence[PlacedEffect], name: str) -> Parameter | None:
    """The number ``CODE.NAME`` of one of the effects over its widest range; None if none has it."""
    code, _, what = name.rpartition(".")
    for one in effects:
        for k, p in enumerate(one.effect.parameters):
            if (one.effect.code, p.name) == (code, what):
                lower, upper, scale = _range_of(p)
                value = p.value(float(one.values[k]))
                return Parameter("", OF_EFFECT, code, (k,), p.si_unit, value, lower, upper, scale)
    return None


def _range_of(p: EffectParameter) -> tuple[float, float, Scale]:
    """Widest range of an effect's number, and how an estimator moves it."""
    if p.scale == "compliance":
        return (*(TURN if p.dimension == "rotational stiffness" else SHIFT), "compliance")
    if p.role == "shape":
        # Pure numbers bend or choose a law within their range only.
        beyond = BEYOND if p.lower > 0.0 and p.dimension != "ratio" else 1.0
        return p.lower / beyond, p.upper * beyond, "log" if p.lower > 0.0 else "linear"
    return -BEYOND * p.upper if p.signed else 0.0, BEYOND * p.upper, "linear"


def own_compliance(model: ArmModel, place: str, a: int, b: int, q: Array) -> Array:
    """The model's compliance (n,) between two rows of base, tool or a joint (SI), or of the bar."""
    if place == "bar":
        return np.full(len(q), 0.0 if model.bar is None else model.bar.compliance)
    if place in model.robot.joint_names:
        joint = model.joints[model.robot.joint_names.index(place)]
        varying = [law.compliance(q) for law in joint.springs_about(a) if a == b]
        return np.full(len(q), joint.bearing[a, b]) + sum(varying, np.zeros(len(q)))
    return np.full(len(q), (model.base if place == BASE else model.tool)[a, b])


def _places(model: ArmModel) -> tuple[str, ...]:
    return (BASE, *model.robot.joint_names, TOOL)


def _softest(row: int) -> float:
    return 1.0 / (SHIFT if row < 3 else TURN)[0]


def _refuse_law(model: ArmModel, place: str, row: int) -> None:
    if place in model.robot.joint_names and any(
        row == given for given, _ in model.joints[model.robot.joint_names.index(place)].laws
    ):
        raise InputError(
            f"parameter {place}.{ROWS[row]}",
            code="M001",
            value="a law over the joint's angle (bearing_laws)",
            allowed="a constant of the model file",
            remedy="leave it as it is, or replace the law by a constant in [joint.bearing]",
        )


def _with(C: Array, a: int, b: int, v: float) -> Array:
    out = C.copy()
    out[a, b] = out[b, a] = v
    return out


def _with_link(model: ArmModel, name: str, flexibility: Array) -> ArmModel:
    """The model with a link of that flexibility; its mesh and stiffness stay, for statics asks neither."""
    links = tuple(
        replace(x, element=replace(x.element, flexibility=flexibility)) if x.name == name else x for x in model.links
    )
    return replace(model, links=links)


def _share(port: Port) -> Array:
    assert port.flexibility is not None  # noqa: S101 - links have one
    return port.share(port.flexibility)
