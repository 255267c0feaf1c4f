"""Shell meshes on disk and links that are made from them: what comes back, and every way in which it may not."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from meshes import BeamMesh, ShellMesh, casing_mesh, link_beam_mesh, link_shell_mesh, load_shell, save_shell
from meshes.array_cache import from_npz, to_npz
from robots import InputError, load_description
from robots.robot import robot_from
from robots.schema.description import Link, Opening, Rim, Surface
from robots.schema.quantities import PositiveLength

Arrays = dict[str, NDArray[np.generic]]


def beam(link: str = "upper-arm") -> tuple[Link, BeamMesh]:
    description = load_description("xr701")
    entry = next(entry for entry in description.link if entry.name == link)
    return entry, link_beam_mesh(description, robot_from(description), entry)


def coarse(link: str = "upper-arm") -> ShellMesh:
    return casing_mesh(beam(link)[1], 0.15)


@pytest.fixture
def mesh() -> ShellMesh:
    """Triangles beside quads, walls of two thicknesses, a name beyond ASCII."""
    tube = coarse()
    cut = tube.quads[:5]
    return replace(
        tube,
        name="Oberarm, 2. Gußteil",
        triangles=np.concatenate([cut[:, [0, 1, 2]], cut[:, [0, 2, 3]]]),
        quads=tube.quads[5:],
        thickness=np.concatenate([np.full(10, 0.004), tube.thickness[5:]]),
    )


def assert_same(a: ShellMesh, b: ShellMesh) -> None:
    for name in ("nodes", "triangles", "quads", "thickness"):
        one, other = getattr(a, name), getattr(b, name)
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    assert (a.youngs_modulus, a.poissons_ratio) == (b.youngs_modulus, b.poissons_ratio)
    assert list(a.interfaces) == list(b.interfaces)
    for name in a.interfaces:
        np.testing.assert_array_equal(a.interfaces[name], b.interfaces[name])


def test_a_mesh_comes_back_as_it_was(mesh: ShellMesh, tmp_path: Path) -> None:
    path = tmp_path / "mesh.npz"
    digest = save_shell(mesh, path)
    assert digest == hashlib.sha256(path.read_bytes()).hexdigest()
    for back in (load_shell(path), load_shell(str(path), digest), load_shell(path, digest.upper())):
        assert_same(back, mesh)
        assert back.name == mesh.name
    assert load_shell(path, name="arm").name == "arm"
    # Equal meshes, equal files; and nothing else in the folder.
    assert save_shell(load_shell(path), tmp_path / "again.npz") == digest
    assert {p.name for p in tmp_path.iterdir()} == {"mesh.npz", "again.npz"}


def test_numpy_alone_reads_the_file(mesh: ShellMesh, tmp_path: Path) -> None:
    save_shell(mesh, tmp_path / "mesh.npz")
    with np.load(tmp_path / "mesh.npz", allow_pickle=False) as file:
        assert file["schema"] == "stiffarm-shell/1"
        np.testing.assert_array_equal(file["nodes"], mesh.nodes)
        assert file["interfaces"].tolist() == ["root", "tip"]


def test_objects_are_not_written() -> None:
    with pytest.raises(ValueError, match="Object arrays"):
        to_npz({"x": np.array([{}], dtype=object)})


def test_a_failed_write_leaves_the_old_file(mesh: ShellMesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "mesh.npz"
    digest = save_shell(mesh, path)

    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", refuse)
    with pytest.raises(OSError, match="No space"):
        save_shell(coarse("forearm"), path)
    assert [p.name for p in tmp_path.iterdir()] == ["mesh.npz"]
    assert load_shell(path, digest).name == mesh.name


def _refused(path: Path, *words: str, sha256: str | None = None) -> None:
    with pytest.raises(InputError) as caught:
        load_shell(path, sha256)
    message = str(caught.value)
    for word in (str(path).replace("\0", "\\x00"), "To fix it: ", *words):
        assert word in message


def test_missing_files(tmp_path: Path) -> None:
    _refused(tmp_path / "gone.npz", "cannot be read", "does not exist", "import the link's surface again")
    _refused(tmp_path, "cannot be read")
    _refused(Path("a\0b"), "cannot be read", "null")


def test_changed_and_damaged_files(mesh: ShellMesh, tmp_path: Path) -> None:
    path = tmp_path / "mesh.npz"
    digest = save_shell(mesh, path)
    content = path.read_bytes()
    save_shell(replace(mesh, thickness=1.1 * mesh.thickness), path)
    _refused(path, "has changed since the model was written", digest, sha256=digest)
    for damaged in (content[:-30], b"", b"not a mesh", content[:100] + b"\xff" + content[101:]):
        path.write_bytes(damaged)
        _refused(path, "has changed since the model was written, or is damaged", sha256=digest)
        _refused(path, "is damaged (")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a: a | {"schema": np.array("stiffarm-shell/2")}, "schema: got 'stiffarm-shell/2'"),
        (lambda a: a | {"schema": np.array(["stiffarm-shell/1"])}, "schema: got"),
        (lambda a: {k: v for k, v in a.items() if k != "schema"}, "schema: got 'none'; allowed: stiffarm-shell/1"),
        (lambda a: {k: v for k, v in a.items() if k != "nodes"}, "arrays missing, or of the wrong kind: got 'nodes'"),
        (lambda a: {k: v for k, v in a.items() if k != "interfaces"}, "wrong kind: got 'interfaces'"),
        (lambda a: {k: v for k, v in a.items() if k != "ring_1"}, "wrong kind: got 'ring_1'"),
        (lambda a: a | {"nodes": a["nodes"].astype(np.complex128)}, "wrong kind: got 'nodes'"),
        (lambda a: a | {"quads": a["quads"].astype(np.float64)}, "wrong kind: got 'quads'"),
        (lambda a: a | {"name": np.array(3.0)}, "wrong kind: got 'name'"),
        (lambda a: a | {"youngs_modulus": np.ones(2)}, "wrong kind: got 'youngs_modulus'"),
        (lambda a: a | {"interfaces": np.array(["root", "root"])}, "wrong kind: got 'interfaces'"),
        (lambda a: a | {"interfaces": np.array([["root"], ["tip"]])}, "wrong kind: got 'interfaces'"),
        (lambda a: a | {"nodes": np.full_like(a["nodes"], np.nan)}, "holds no valid mesh (shell mesh"),
        (lambda a: a | {"quads": a["quads"] + 10_000}, "holds no valid mesh"),
        (lambda a: a | {"thickness": -a["thickness"]}, "holds no valid mesh"),
        (lambda a: a | {"nodes": a["nodes"][:, :2]}, "holds no valid mesh"),
        (lambda a: a | {"ring_0": a["ring_0"].reshape(2, -1)}, "holds no valid mesh"),
    ],
)
def test_contents_that_are_no_mesh(
    mesh: ShellMesh, tmp_path: Path, change: Callable[[Arrays], Arrays], words: str
) -> None:
    path = tmp_path / "mesh.npz"
    save_shell(mesh, path)
    path.write_bytes(to_npz(change(from_npz(path.read_bytes()))))
    _refused(path, words)


def test_a_pickle_is_not_run(tmp_path: Path) -> None:
    path = tmp_path / "mesh.npz"
    np.savez(path, schema=np.array([{"a": 1}], dtype=object))
    _refused(path, "is damaged (ValueError: Object arrays cannot be loaded")


# Links


def with_surface(link: str, mesh: ShellMesh, folder: Path, **changes: object) -> tuple[Link, BeamMesh]:
    entry, beam_mesh = beam(link)
    path = folder / f"{link}.npz"
    digest = save_shell(mesh, path)
    wall = _length(float(mesh.thickness.max()))
    surface = Surface(file=str(path), sha256=digest, wall=wall, size=_length(0.15), source="assumed")
    return entry.model_copy(update={"surface": surface.model_copy(update=changes)}), beam_mesh


def _length(metres: float) -> PositiveLength:
    return PositiveLength.model_validate({"value": 1e3 * metres, "unit": "mm", "source": "assumed"})


@pytest.mark.parametrize("link", ["upper-arm", "forearm"])
def test_a_surface_takes_the_casings_place(link: str, tmp_path: Path) -> None:
    mesh = coarse(link)
    # Another order of the interfaces and another material: the description's are the model's.
    turned = replace(
        mesh, name="scan 7", youngs_modulus=1.0, poissons_ratio=0.0, interfaces=dict(reversed(mesh.interfaces.items()))
    )
    entry, beam_mesh = with_surface(link, turned, tmp_path)
    opening = Opening(side="+y", along=(0.4, 0.6), across=(0.3, 0.7), source="assumed")
    entry = entry.model_copy(update={"opening": (opening,), "rim": Rim(length=_length(0.06), wall=_length(0.02))})
    made = link_shell_mesh(entry, beam_mesh)
    assert_same(made, mesh)
    assert made.name == beam_mesh.name


def test_without_a_surface_it_is_the_casing() -> None:
    entry, beam_mesh = beam("upper-arm")
    plain = entry.model_copy(update={"opening": (), "rim": None})
    assert_same(link_shell_mesh(plain, beam_mesh), casing_mesh(beam_mesh))


def test_openings_and_rims_reach_the_casing() -> None:
    entry, beam_mesh = beam("upper-arm")
    opening = Opening(side="+y", along=(0.4, 0.6), across=(0.3, 0.7), source="assumed")
    rim = Rim(length=_length(0.06), wall=_length(0.02))
    entry = entry.model_copy(update={"opening": (opening,), "rim": rim})
    made = link_shell_mesh(entry, beam_mesh)
    assert_same(made, casing_mesh(beam_mesh, openings=(opening,), rim=rim))
    assert made.thickness.max() == pytest.approx(0.02)
    assert len(made.quads) != len(casing_mesh(beam_mesh).quads)


def _link_refused(link: tuple[Link, BeamMesh], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        link_shell_mesh(*link)
    assert "To fix it: " in str(caught.value)


def test_interfaces_that_the_link_does_not_have(tmp_path: Path) -> None:
    missing = replace(coarse("forearm"), interfaces={k: coarse("forearm").interfaces[k] for k in ("root", "tip")})
    _link_refused(
        with_surface("forearm", missing, tmp_path),
        "surface of link forearm, .*interfaces: got 'root, tip'; allowed: exactly root, tip, pin",
    )
    spare = replace(coarse(), interfaces={**coarse().interfaces, "pin": np.arange(3)})
    _link_refused(with_surface("upper-arm", spare, tmp_path), "allowed: exactly root, tip. To fix")


@pytest.mark.parametrize("change", [lambda x: 1000.0 * x, lambda x: x + 2.0, lambda x: 0.2 * x])
def test_a_surface_that_does_not_meet_the_joints(change: Callable[[object], object], tmp_path: Path) -> None:
    mesh = coarse()
    moved = replace(mesh, nodes=change(mesh.nodes))
    _link_refused(with_surface("upper-arm", moved, tmp_path), r"middle of ring (root|tip) is .* mm from the link's")


def test_another_wall_than_the_surface_was_made_for(tmp_path: Path) -> None:
    _link_refused(
        with_surface("upper-arm", coarse(), tmp_path, wall=_length(0.02)),
        r"wall of link upper-arm's surface \(mm\): got 20.0; allowed: .*import the link's surface again",
    )


def test_a_changed_file_is_named(tmp_path: Path) -> None:
    _link_refused(with_surface("upper-arm", coarse(), tmp_path, sha256="0" * 64), "has changed since the model was")
