"""The step `sensitivity` over any numbers of a model: ranges, loaded poses, studies; its tables and JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

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
from stiffarm.commands.calibrate.words import spoken_unit
from stiffarm.session.json_text import number
from stiffarm.session.words.directions import direction_words

Method = Literal["morris", "sobol", "derivative"]

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


def table(s: Study) -> tuple[str, list[str], list[list[str]]]:
    """Title, columns and rows: each number's importance, mean and range over the poses."""
    factor, unit = s.factor_unit
    f = s.found
    columns = {
        "sobol": {"total index": f.total, "first order": f.first},
        "morris": {f"mean effect ({unit})": f.mean_effect * factor, f"spread ({unit})": f.spread * factor},
        "derivative": {},
    }[s.method]
    exact = (
        {"by derivatives": variance_shares(f.derivative)}
        if s.method == "sobol"
        else {"share of derivatives": f.derivative}
    )
    columns = {**columns, **exact}
    rows = [[p.name, *(_over_poses(values[:, k]) for values in columns.values())] for k, p in enumerate(s.parameters)]
    what = f"d{s.component}" if len(s.component) == 1 else s.component
    title = f"{s.method.capitalize()} study of {what} at {len(s.labels)} loaded poses: mean, and largest of them"
    return title, ["number", *columns], rows


def _over_poses(values: Array) -> str:
    known = values[~np.isnan(values)]
    return f"{known.mean():.3g}, {known.max():.3g}" if known.size else "-"


def range_text(p: Parameter) -> str:
    """The range a number was varied over."""
    factor, unit = spoken_unit(p)
    return f"{p.lower * factor:.3g} to {p.upper * factor:.3g} {unit}"


def payload(s: Study) -> dict[str, Any]:
    """For sensitivity.json."""
    factor, unit = s.factor_unit
    f = s.found
    parts: dict[str, dict[str, Array]] = {
        "sobol": {"first": f.first, "first_conf95": f.first_conf, "total": f.total, "total_conf95": f.total_conf},
        "morris": {f"mean_effect_{unit}": f.mean_effect * factor, f"spread_{unit}": f.spread * factor},
        "derivative": {},
    }
    columns = {
        **parts[s.method],
        "derivative_share": f.derivative,
        "derivative_variance_share": variance_shares(f.derivative),
    }
    return {
        "method": s.method,
        "component": s.component,
        "runs": f.runs,
        "seed": s.seed,
        "ranges": {p.name: {"low": number(p.lower), "high": number(p.upper), "unit": p.unit} for p in s.parameters},
        "poses": [
            {
                "pose": label,
                "load_N": number(float(s.loads_N[o])),
                "direction": s.directions[o],
                "numbers": {
                    p.name: {name: number(float(values[o, k])) for name, values in columns.items()}
                    for k, p in enumerate(s.parameters)
                },
            }
            for o, label in enumerate(s.labels)
        ],
    }


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
