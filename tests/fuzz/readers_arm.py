"""Readers of what an arm is: model files, URDF, surfaces, shells, kept arrays, surrogates."""

from __future__ import annotations

import hashlib
import json
import math
import re
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import fem
from doe import bundled_data, read_measurements
from doe.estimation.campaign import campaign_of
from fem.arm import Arm
from fem.effects import build_arm, reading_effects
from meshes.array_cache import ArrayCache
from meshes.link_shells import load_shell, save_shell
from meshes.shell_mesh import ShellMesh
from meshes.surfaces.reading import read_surface
from robots import forward_kinematics, load_description, load_robot, read_urdf
from robots.files.published import FORM, JOURNAL, heal
from robots.library.models import parse_description, to_toml
from robots.robot import Robot, robot_from
from stiffarm.commands.calibrate.step import Request, calibrate
from stiffarm.commands.simulate.command import SimulateRequest
from stiffarm.commands.simulate.pose import at_pose
from stiffarm.session.inputs import read_model
from surrogate.asking import query
from surrogate.designs import space_filling_design
from surrogate.error_bars import ParameterBars, learn_bars
from surrogate.fit import fit
from surrogate.maps.store import MapStore
from surrogate.model import ErrorFigures, Quantity, Surrogate
from surrogate.scope import Couplings, Scope
from surrogate.storage import load_surrogate, save_surrogate

from .mutate_bytes import Mutation
from .mutate_forms import arrays, binary_stl, words, xml
from .mutate_trees import tree_mutation
from .registry import Reader
from .samples import Sample
from .trial import ROOT, require, require_finite, same

TOML, JSON = tree_mutation("toml"), tree_mutation("json")
DATA = ROOT / "robots" / "data"
URDFS = ROOT / "tests" / "robots" / "data"
MANY_POSES = 3


def texts(*paths: Path) -> list[Sample]:
    """Files as samples."""
    return [Sample(path.suffix, path.read_bytes()) for path in paths]


def _checked_robot(robot: Robot, where: str) -> None:
    """Forward kinematics over the whole range are rotations and places within an arm's reach."""
    share = np.linspace(0.0, 1.0, MANY_POSES)[:, None]
    q = robot.limits[:, 0] + share * (robot.limits[:, 1] - robot.limits[:, 0])
    found = forward_kinematics(robot, q)
    require_finite(found, f"{where} kinematics")
    R = found.R_flange
    require(np.allclose(R @ R.swapaxes(1, 2), np.eye(3), atol=1e-6), f"{where} rotations: no rotations")


LAWS = {
    "j1": 'stiffness = { value = 2e6, unit = "N m/rad", source = "assumed" }',
    "j2": 'stiffness = { kind = "table", input = "q2_deg", nodes_deg = [-90, 0], stiffness_Nm_per_rad = [1e6, 2e6], '
    'source = "assumed" }',
    "j3": 'stiffness = { kind = "log-fourier", input = "q3_deg", coefficients = [14, 0.1, -0.1], source = "assumed" }',
    "j4": 'stiffness = { kind = "log-polynomial", inputs = ["q4_deg"], centre_deg = [0], half_range_deg = [180], '
    'exponents = [[0], [2]], coefficients = [12, 0.1], source = "assumed" }',
}
EFFECTS = """
[[effect]]
code = "backlash:j2"
parameters.gap = { value = 0.5, unit = "mrad", source = "assumed" }
parameters.crossing = { value = 20, unit = "N m", source = "assumed" }
parameters.preload = { value = 100, unit = "%", source = "assumed" }
[[effect]]
code = "friction:j3"
parameters.share = { value = 1, unit = "1", source = "assumed" }
parameters.friction = { value = 100, unit = "N m", source = "assumed" }
[[effect]]
code = "base-tilt"
parameters.stiffness_y = { value = 2e7, unit = "N m/rad", source = "assumed" }
"""
JOINT_ERROR = """
error.x = { value = 0.3, unit = "mm", source = "assumed" }
error.ry = { value = 0.01, unit = "deg", source = "assumed" }
error.turns_with = [{ joint = "j3", factor = { value = 0.001, unit = "1", source = "assumed" } }]
error.curve = { sin_mrad = [0.1], cos_mrad = [0.2], identified_deg = [[-9, 40]], height_mrad = 1, source = "assumed" }
"""
POSITIONS = """
[positions]
data = "read.csv"
data_sha256 = "0"
before_rms_mm = 1.0
rms_mm = 0.1
left_out_rms_mm = 0.12
"""


def _models() -> list[Sample]:
    """The bundled robots; one with laws and effects; as calibrations leave it, covariance and errors of joints."""
    sprung = re.sub(r"\nstiffness = .*", "", (DATA / "kr60-3.toml").read_text(encoding="utf-8"))
    for joint, law in LAWS.items():
        sprung = sprung.replace(f'[[joint]]\nname = "{joint}"', f'[[joint]]\nname = "{joint}"\n{law}')
    given = read_model("xr701", "beam", None)
    data = read_measurements(bundled_data("xr701"), given.robot)
    request = Request(campaign_of("xr701", ("j2.stiffness", "j3.stiffness")))
    calibrated = to_toml(calibrate(given, data, request).description)
    off = calibrated.replace('name = "j2"', f'name = "j2"\n{JOINT_ERROR}', 1) + POSITIONS
    made = [Sample(".toml", text.encode()) for text in (sprung + EFFECTS, calibrated, off)]
    return [*texts(*sorted(DATA.glob("*.toml"))), *made]


def _model(path: Path) -> object:
    description = load_description(path)
    _checked_robot(robot_from(description), "model")
    back = parse_description(to_toml(description), "written back")
    require(back == description, "model round trip: another description")
    model = build_arm(description)
    q = model.robot.limits.mean(axis=1)[None]
    C = fem.compliance(model, q)
    require_finite(C, "model compliance")
    scale = np.sqrt(np.abs(np.diagonal(C[0])))
    with np.errstate(all="ignore"):
        scaled = np.nan_to_num(C[0] / np.outer(scale, scale))
    require(np.linalg.eigvalsh(0.5 * (scaled + scaled.T)).min() > -1e-6, "model compliance: energy out of nothing")
    given = Arm(description, model.robot, model, reading_effects(description, model))
    found = at_pose(given, q[0], np.array([0.0, 0.0, -100.0, 0.0, 0.0, 0.0]), SimulateRequest())
    require(all(math.isfinite(one.value) for one in found.numbers.values()), "model deflection: not finite")
    return model


def _urdf(path: Path) -> object:
    found = read_urdf(path)
    _checked_robot(robot_from(found.description), "URDF")
    require_finite(found.masses, "URDF masses")
    require_finite(found.visuals, "URDF visuals")
    require_finite(found.collisions, "URDF collisions")
    return found


@cache
def _surfaces() -> tuple[Sample, ...]:
    box = trimesh.creation.box((0.4, 0.3, 0.2))
    kinds = ("stl", "stl_ascii", "obj", "ply", "dae")
    out = [Sample(f".{kind.partition('_')[0]}", _bytes(box.export(file_type=kind))) for kind in kinds]
    plain = _bytes(box.export(file_type="ply", encoding="ascii"))
    quads = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nusemtl x\nf 1//1 2//1 3//1 4//1\nf -1 -2 -3\n"
    return (*out, Sample(".ply", plain), Sample(".obj", quads), *texts(ROOT / "tests/robots/data/meshes/pyramid.stl"))


def _bytes(data: bytes | str) -> bytes:
    return data if isinstance(data, bytes) else data.encode()


def _surface(path: Path) -> object:
    nodes, faces, notes = read_surface(path, None)
    require(np.isfinite(nodes).all(), "surface corners: not finite")
    there = bool(faces.size) and faces.min() >= 0 and faces.max() < len(nodes)
    require(there, "surface faces: of corners that are not there")
    return notes


@cache
def _shell_mesh() -> ShellMesh:
    square = ((0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1))
    corners = np.array([[x, y, z] for z in (0.0, 0.5, 1.0) for x, y in square])
    quads = [[4 * k + i, 4 * k + (i + 1) % 4, 4 * k + 4 + (i + 1) % 4, 4 * k + 4 + i] for k in (0, 1) for i in range(4)]
    rings = {"root": np.arange(4), "tip": np.arange(8, 12)}
    triangles = np.zeros((0, 3), dtype=np.int64)
    return ShellMesh("tube", corners, triangles, np.array(quads), np.full(8, 0.01), 2.1e11, 0.3, rings)


def _shells() -> list[Sample]:
    return [_saved(lambda path: save_shell(_shell_mesh(), path), ".npz")]


def _saved(save: Any, suffix: str) -> Sample:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"seed{suffix}"
        save(path)
        return Sample(suffix, path.read_bytes())


def _shell(path: Path) -> object:
    mesh = load_shell(path)
    require_finite(mesh, "shell mesh")
    require((mesh.thickness > 0).all() and mesh.youngs_modulus > 0.0, "shell wall: not positive")
    for elements in (mesh.triangles, mesh.quads, *mesh.interfaces.values()):
        low, high = elements.min(initial=0), elements.max(initial=0)
        require(low >= 0 and high < max(1, len(mesh.nodes)), "shell nodes: elements of nodes that are not there")
    return mesh


KEY = "0123456789abcdef" * 4
_KEPT = {"points": np.arange(6.0).reshape(2, 3), "stiffness": np.diag(np.arange(1.0, 13.0)), "flexibility": np.eye(6)}


def _kept() -> list[Sample]:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        ArrayCache(Path(folder)).put(KEY, _KEPT)
        (path,) = Path(folder).glob("*.arrays")
        return [Sample(".arrays", path.read_bytes())]


def _cached(path: Path) -> object:
    folder = path.parent / "kept"
    folder.mkdir(exist_ok=True)
    shutil.copyfile(path, folder / f"{KEY}.arrays")
    found = ArrayCache(folder).get(KEY)
    # The mark, the key and the checksum are in the head: what comes back is what was put, or nothing.
    if found is not None:
        whole = all(same(found.get(name), array) for name, array in _KEPT.items())
        require(whole, "kept arrays: not those that were put")
    return found


def _seal_json(data: bytes) -> bytes:
    """A surrogate's checksum written anew."""
    try:
        content = json.loads(data)
        own = {key: value for key, value in content.items() if key != "content_sha256"}
        text = json.dumps(own, sort_keys=True, separators=(",", ":"))
    except (ValueError, RecursionError, AttributeError, TypeError):
        return data
    return json.dumps(own | {"content_sha256": hashlib.sha256(text.encode()).hexdigest()}).encode()


@cache
def _learned() -> Surrogate:
    """A small surrogate with everything that a file may hold but a factor; no arm was solved for it."""
    lower, upper = np.array([-0.6, 0.7]), np.array([0.8, 2.0])
    couplings = Couplings(("sum",), np.array([[1.0, 1.0]]), np.array([-np.inf]), np.array([2.7]))
    scope = Scope(
        robot="xr701",
        model_hash="0f" * 32,
        load_direction=(0.6, 0.0, -0.8),
        inputs=("q2_deg", "q3real_deg"),
        fixed_deg={"q1_deg": 0.1, "q4_deg": -12.3},
        lower=lower,
        upper=upper,
        couplings=couplings,
        periodic=(False, True),
    )
    rng = np.random.default_rng(0)
    Q = space_filling_design(lower, upper, 60, rng, couplings=couplings)
    found = fit(Q, 1e-6 * (1.3 + np.cos(Q[:, 0]) * np.sin(Q[:, 1])), scope, "polynomial", 2, "logarithm")
    fresh = space_filling_design(lower, upper, 220, rng, density="random", couplings=couplings)
    bars = learn_bars(found.basis, scope, Q, fresh, np.sin(1e3 * fresh[:, 0]))
    small = found.basis.take(np.arange(3))
    return Surrogate(
        **{name: getattr(scope, name) for name in Scope.__dataclass_fields__},
        quantity=Quantity("compliance", "m/N", "compliance"),
        basis="polynomial",
        degree=found.basis.degree,
        target="logarithm",
        expansion=found.basis.expansion(found.coefficients),
        errors=ErrorFigures("polynomial", 2, "logarithm", 3, 4, 5, *(0.1,) * 5, 0.95, 300.0, None, 0.2),
        bars=bars,
        parameters=ParameterBars(
            small.expansion(1e-8 * np.arange(6.0).reshape(3, 2)),
            ("j2", "j3"),
            0.01,
            ("j4",),
            small.expansion(np.array([0.1, 0.0, 0.0])),
        ),
        kinematics=load_robot("xr701"),
        fixed_influence={"q1_deg": 0.0, "q4_deg": 1.0 / 3.0},
        notes=("made up",),
    )


def _surrogates() -> list[Sample]:
    return [_saved(lambda path: save_surrogate(_learned(), path), ".json")]


def _surrogate(path: Path) -> object:
    found = load_surrogate(path)
    copy = path.with_name("copy.json")
    save_surrogate(found, copy)
    again = load_surrogate(copy)
    require(
        same(again.expansion.coefficients, found.expansion.coefficients), "surrogate round trip: other coefficients"
    )
    answer = query(found, 0.5 * (found.lower + found.upper)[None])
    if not answer.faults:
        require_finite(answer.value, "surrogate value")
        require((answer.value > 0).all(), "surrogate value: a stiffness below 0")
        require(not np.isnan(answer.model_error).any(), "surrogate error: NaN")
    return found


COLUMNS = {"k": np.dtype("<f8"), "q": np.dtype(("<f8", (2,)))}


def _work() -> dict[str, bytes]:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        store = _store(Path(folder))
        for i in range(store.blocks):
            store.write(i, _block(store, i))
        return {p.name: p.read_bytes() for p in Path(folder).iterdir()}


def _block(store: MapStore, number: int) -> dict[str, np.ndarray]:
    n = store.rows(number).stop - store.rows(number).start
    return {"k": np.full(n, 18827.0 + number), "q": np.full((n, 2), 0.5)}


def _store(folder: Path) -> MapStore:
    return MapStore(10, 4, COLUMNS, "ab" * 32, folder)


@cache
def _worked() -> dict[str, bytes]:
    return _work()


def _work_files() -> list[Sample]:
    return [Sample(f".{name}", data) for name, data in _worked().items()]


def _map_work(path: Path) -> object:
    """One file of a work folder changed: a block that counts as done holds what was written."""
    folder = path.parent / "work"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, content in _worked().items():
        (folder / name).write_bytes(path.read_bytes() if path.name == f"input.{name}" else content)
    store = _store(folder)
    for i in store.missing():
        store.write(i, _block(store, i))
    kept = store.finished()
    for i in range(store.blocks):
        for name, wanted in _block(store, i).items():
            same = (kept[name][store.rows(i)] == wanted).all()
            require(bool(same), "map work: a block that counts as done holds other numbers")
    return store


OBJ = words((b"f 1 2 3", b"f 1 2 99999", b"f 0 0 0", b"v nan 0 0", b"v 1e308 1e308 1e308", b"f -9 -8 -7", b"l 1 2"))


def _journals() -> list[Sample]:
    names = {name: hashlib.sha256(content).hexdigest() for name, content in _NEW.items()}
    content = {"schema": FORM, "stage": _STAGE, "backup": "previous/20261122-101112", "made": ["sub"], "sha256": names}
    return [Sample(".json", json.dumps(content, indent=1).encode())]


_STAGE, _NEW = ".partial-0123456789ab", {"a.txt": b"new a", "sub/b.txt": b"new b"}


def _journal(path: Path) -> object:
    """A run killed while its results moved, and a journal that says anything: nothing is lost, nothing gets out."""
    folder, beside = path.parent / "published", path.parent / "beside.txt"
    shutil.rmtree(folder, ignore_errors=True)
    for name, content in {"a.txt": b"old a", **{f"{_STAGE}/{name}": new for name, new in _NEW.items()}}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    beside.write_bytes(b"somebody else's")
    shutil.copyfile(path, folder / JOURNAL)
    try:
        heal(folder)
    finally:
        require(beside.read_bytes() == b"somebody else's", "journal: a file outside of the folder has changed")
        kept = [p.read_bytes() for p in folder.rglob("*") if p.is_file()]
        require(b"old a" in kept, "journal: the result before is lost")
    return None


SURFACE: tuple[Mutation, ...] = (OBJ, binary_stl, xml)

READERS: dict[str, Reader] = {
    "model file": Reader(_models, _model, (TOML,), cost=12.0),
    "URDF": Reader(
        lambda: texts(*(URDFS / f"{name}.urdf" for name in ("six_axis", "crooked", "offset_wrist"))),
        _urdf,
        (xml,),
        cost=3.0,
    ),
    "surface file": Reader(lambda: list(_surfaces()), _surface, SURFACE, cost=3.0),
    "shell file": Reader(_shells, _shell, (arrays,)),
    "array cache": Reader(_kept, _cached, (arrays,)),
    "surrogate file": Reader(_surrogates, _surrogate, (JSON,), _seal_json, cost=2.0),
    "journal of results": Reader(_journals, _journal, (JSON,), cost=6.0),
    "map work": Reader(_work_files, _map_work, (JSON,), cost=2.0),
}
