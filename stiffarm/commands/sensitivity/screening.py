"""The step `sensitivity` over any numbers of a model: ranges, loaded poses, studies; its tables and JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from doe import Measurements, loaded_points
from doe.estimation.campaign import Campaign
from doe.planning.screening import Screening, screen, variance_shares
from doe.tables.measurements import largest_rows, load_size
from fem.arm import Arm
from fem.elements.walls import wall_flexibilities
from fem.free.model import FreeModel
from fem.free.parameters import FreeLaw, Parameter, parameter
from fem.statics.loads import as_loaded
from robots import InputError, require_one_of
from robots.arrays import Array, Indices
from robots.quantities import Quantity
from stiffarm.commands.calibrate.words import spoken_unit
from stiffarm.commands.sensitivity.ranking import MOST_PANELS, ranking
from stiffarm.result import Result, Table
from stiffarm.session.words.directions import direction_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Method = Literal["morris", "sobol", "derivative"]

LOAD: Final = Quantity("load", "N")
COMPONENTS: Final = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}


@dataclass(frozen=True)
class Study:
    """A study of o loaded poses: ``labels`` (o,), ``loads_N`` (o,), ``directions`` (o,) in words."""

    method: Method
    component: str
    parameters: tuple[Parameter, ...]
    labels: tuple[str, ...]
    loads_N: Array  # noqa: N815 - the unit's letter
    directions: tuple[str, ...]
    found: Screening
    seed: int

    @property
    def factor_unit(self) -> tuple[float, str]:
        """From m or rad to what is shown."""
        return 1e3, "mm" if COMPONENTS[self.component] < 3 else "mrad"

    @property
    def names(self) -> list[str]:
        """Labels of the loaded poses, with the direction where a pose is loaded in several."""
        several = len(set(self.directions)) > 1
        return [f"{a}, {d}" if several else a for a, d in zip(self.labels, self.directions, strict=True)]


def study(
    given: Arm,
    data: Measurements,
    method: Method,
    numbers: Sequence[str] | Campaign,
    springs: tuple[float, float],
    *,
    component: str = "z",
    samples: int = 512,
    trajectories: int = 40,
    seed: int = 0,
) -> Study:
    """Vary ``numbers`` at the poses of ``data``, each under its largest load in each direction.

    ``springs`` N m/rad: the range of joint springs.

    Raises
    ------
    InputError
        Unknown numbers or component, no number at all, samples that are no power of two.
    """
    require_one_of("--component", component, COMPONENTS, code="A001", remedy="choose one of them")
    parameters, laws = _free(given, numbers, springs)
    if isinstance(numbers, Campaign) and numbers.robot != given.robot.name:
        raise InputError("calibration file is for robot", code="A010", value=numbers.robot, allowed=given.robot.name)
    rows, directions = _cases(data)
    at = as_loaded(given.model, data.q[rows], data.wrench[rows], loaded_points(given.model, data)[rows])
    walls = wall_flexibilities(given.description, given.model, parameters)
    free = FreeModel(given.model, parameters, at, laws, walls)
    methods = () if method == "derivative" else (method,)
    found = screen(free, COMPONENTS[component], samples=samples, trajectories=trajectories, seed=seed, methods=methods)
    labels = tuple(data.pose[i] for i in rows)
    return Study(method, component, parameters, labels, data.loads_N[rows], directions, found, seed)


def read_most(data: Measurements) -> str:
    """The translation that is largest in the readings; z where none was read."""
    component, size = data.largest
    return "z" if np.isnan(size).all() else "xyz"[component[np.nanargmax(size)]]


def _free(
    given: Arm, numbers: Sequence[str] | Campaign, springs: tuple[float, float]
) -> tuple[tuple[Parameter, ...], tuple[FreeLaw, ...]]:
    if not isinstance(numbers, Campaign):
        return tuple(_ranged(parameter(given.model, name), springs) for name in numbers), ()
    own = {p.name for p in numbers.parameter if p.lower is not None or p.upper is not None}
    parameters, laws = numbers.free(given.model)
    return tuple(p if p.name in own else _ranged(p, springs) for p in parameters), laws


def _ranged(p: Parameter, springs: tuple[float, float]) -> Parameter:
    """The parameter over its usual range."""
    return p.between(*p.kind.screened(p, springs))


def _cases(data: Measurements) -> tuple[Indices, tuple[str, ...]]:
    """Row of the largest load of each pose and direction, and the directions in words."""
    force, size = data.loads_N > 0.0, load_size(data.wrench)
    unit = np.where(force[:, None], data.wrench[:, :3], data.wrench[:, 3:]) / size[:, None]
    words = ["" if f else "moment " for f in force]
    words = [w + direction_words(np.round(d, 2)) for w, d in zip(words, unit, strict=True)]
    rows = largest_rows(list(zip(data.pose, words, strict=True)), size)
    return rows, tuple(words[i] for i in rows)


def range_text(p: Parameter) -> str:
    """The range a number was varied over."""
    factor, unit = spoken_unit(p)
    return f"{p.lower * factor:.3g} to {p.upper * factor:.3g} {unit}"


def result(given: Arm, data: Measurements, s: Study) -> Result:
    """The study with its tables: each parameter at each loaded pose, and means and largest values over the poses."""
    f, names, n = s.found, [p.name for p in s.parameters], len(s.labels)
    factor, unit = s.factor_unit
    effects = {
        "sobol": (
            Quantity("total", label="total index", digits=3),
            Quantity("first", label="first order", digits=3),
            Quantity("total_conf95"),
            Quantity("first_conf95"),
        ),
        "morris": (Quantity("mean_effect", unit, factor, "mean effect"), Quantity("spread", unit, factor)),
        "derivative": (),
    }[s.method]
    arrays = {
        "sobol": (f.total, f.first, f.total_conf, f.first_conf),
        "morris": (f.mean_effect, f.spread),
        "derivative": (),
    }[s.method]
    exact = (
        (Quantity("derivative_share", label="share of derivatives", digits=3), f.derivative),
        (Quantity("derivative_variance_share", label="by derivatives", digits=3), variance_shares(f.derivative)),
    )
    values = [*zip(effects, arrays, strict=True), *exact]
    labels: dict[str, Sequence[str]] = {
        "pose": [label for label in s.labels for _ in names],
        "direction": [words for words in s.directions for _ in names],
        "parameter": names * n,
    }
    every = {LOAD: np.repeat(s.loads_N, len(names))} | {q: array.ravel() for q, array in values}
    shown = [(q, array) for q, array in values if "conf95" not in q.key]
    over = {
        replace(q, key=f"{q.key}_{what}", label=f"{q.name}, {what}"): np.array([of(column) for column in array.T])
        for q, array in shown
        for what, of in (("mean", _mean), ("largest", _largest))
    }
    what = f"d{s.component}" if len(s.component) == 1 else s.component
    title = f"{s.method.capitalize()} study of {what} at {n} loaded poses"
    ends = {
        Quantity("low"): np.array([p.lower for p in s.parameters]),
        Quantity("high"): np.array([p.upper for p in s.parameters]),
    }
    tables = (
        Table("effects", "Every parameter at every loaded pose", labels, every, folded=True),
        Table("over_poses", title, {"parameter": names}, over),
        Table("ranges", "Ranges, SI", {"parameter": names, "unit": [p.unit for p in s.parameters]}, ends, folded=True),
    )
    size: Array = {
        "sobol": f.total,
        "morris": f.mean_effect / np.maximum(f.mean_effect.sum(axis=1, keepdims=True), 1e-300),
        "derivative": variance_shares(f.derivative),
    }[s.method]
    size = np.nan_to_num(size)
    return ranking(
        given,
        data,
        names,
        size,
        [names[int(k)] for k in size.argmax(axis=1)],
        tuple(f"{p.name} from {range_text(p)}" for p in s.parameters),
        f"{s.method.capitalize()} study of d{s.component} with {f.runs} runs of the model, seed {s.seed}.",
        partial(_figure, few(s, MOST_PANELS), what),
        tables,
        {"method": s.method, "component": s.component, "runs": f.runs, "seed": s.seed},
    )


def _figure(s: Study, what: str) -> Figure:
    from stiffarm.commands.sensitivity.figures import morris_figure, shares_figure

    if s.method == "morris":
        return morris_figure(s.found, s.names, what, *s.factor_unit)
    return shares_figure(s.found, s.names, what)


def _mean(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else np.nan


def _largest(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else np.nan


def few(s: Study, most: int) -> Study:
    """The study at ``most`` of its loaded poses at most, spread evenly over them, for a picture."""
    if len(s.labels) <= most:
        return s
    kept = np.unique(np.linspace(0, len(s.labels) - 1, most).round().astype(int))
    f = s.found
    fields = ("first", "first_conf", "total", "total_conf", "mean_effect", "spread", "derivative")
    found = replace(f, **{name: getattr(f, name)[kept] for name in fields})
    return replace(
        s,
        labels=tuple(s.labels[k] for k in kept),
        loads_N=s.loads_N[kept],
        directions=tuple(s.directions[k] for k in kept),
        found=found,
    )
