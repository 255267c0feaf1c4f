"""Finished maps for the tests of the writers: known numbers at the points of a layout."""

from __future__ import annotations

import numpy as np

from surrogate.maps.data import Axis, Field, Layout, MapData

MM = 1e-3
ODD_METADATA = {
    "robot": "xr701",
    "note": "größer ≥ 1 <&> \"quoted\" 'too'\nsecond line",
    "load direction <&\"'>\n größe": "-Z",
    "units": "a name of the writer's own",
    "empty": "",
    "control\x01": "control \x01 byte, lone \udcff surrogate",
    "long": "x" * 100_000,
}


def box(nz=4, ny=3, nx=5, first=(-100.0, 50.0, 20.0), step=(10.0, 20.0, 30.0)):
    names, counts = "xyz", (nx, ny, nz)
    axes = [Axis(n, "mm", f + s * np.arange(c)) for n, f, s, c in zip(names, first, step, counts, strict=True)]
    return Layout("box", tuple(reversed(axes)))


def cylinder(phi, r=(100.0, 150.0, 300.0), z=(0.0, 50.0)):
    return Layout(
        "cylinder",
        (Axis("z", "mm", np.array(z)), Axis("phi", "deg", np.array(phi)), Axis("r", "mm", np.array(r))),
    )


def points_of(layout, held=7.0):
    """(n, 3) m; a sweep of joints is bent into space by a smooth map."""
    mesh = np.meshgrid(*(axis.values for axis in layout.axes), indexing="ij")
    value = {axis.name: m.ravel() for axis, m in zip(layout.axes, mesh, strict=True)}
    if layout.kind == "cylinder":
        phi = np.radians(value["phi"])
        value |= {"x": value["r"] * np.cos(phi), "y": value["r"] * np.sin(phi)}
    if layout.kind == "joints":
        a, b, c = [np.zeros(layout.n), np.zeros(layout.n), *value.values()][-3:]
        value = {"x": 5.0 * a + 0.01 * b**2, "y": 3.0 * b, "z": 2.0 * c + 0.02 * a * b}
    return np.column_stack([np.broadcast_to(value.get(name, held), layout.n) for name in "xyz"]) * MM


def finished(layout, reached=None, metadata=None, seed=0):
    """A map with a field, one of categories, shares and two joints, NaN where not reached."""
    rng = np.random.default_rng(seed)
    n = layout.n
    reached = np.ones(n, dtype=bool) if reached is None else reached
    hole = np.where(reached, 1.0, np.nan)
    worst = np.where(reached, rng.integers(0, 3, n), -1).astype(float)
    return MapData(
        layout=layout,
        points=points_of(layout),
        q=rng.uniform(-3.0, 3.0, (n, 2)) * hole[:, None],
        reached=reached,
        coordinates=("q2_deg", "q3real_deg"),
        fields={
            "stiffness_N_per_mm": Field(rng.uniform(200.0, 900.0, n) * hole, "N/mm", "stiffness along -Z"),
            "softest_part": Field(worst, "", "part that deflects most", ("link 2", "größte <&>", "base")),
            "isotropy": Field(rng.uniform(0.0, 1.0, n) * hole, "", "isotropy"),
        },
        parts=("link 2", "base"),
        shares=rng.uniform(0.0, 1.0, (n, 2)) * hole[:, None],
        metadata={"robot": "xr701"} if metadata is None else metadata,
    )


def arrays_of(data):
    """What a reader must find at each point: name -> values."""
    columns = {name: field.values for name, field in data.fields.items()}
    columns |= {f"share_of_{p.replace(' ', '_')}_percent": 100.0 * data.shares[:, i] for i, p in enumerate(data.parts)}
    return columns | {name: np.degrees(data.q[:, i]) for i, name in enumerate(data.coordinates)}


def with_junk(data):
    """The same map with numbers where the robot does not reach, as left over in an array that was not cleared."""
    for values in [*(field.values for field in data.fields.values()), data.q, data.shares]:
        values[~data.reached] = 1.0
    return data
