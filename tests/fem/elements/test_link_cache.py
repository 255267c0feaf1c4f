"""Condensed links from the cache: the same numbers bit for bit, and never those of something else."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

from fem import build_model
from fem.elements import link_cache
from fem.elements.condensation import Superelement
from fem.elements.couplings import Coupling
from fem.elements.link_cache import cached_superelement, superelement_key
from fem.elements.shell import shell_superelement
from meshes import ShellMesh, array_cache
from meshes.array_cache import ArrayCache, formulation_hash
from robots import ModelDescription
from robots.arrays import Array

RIGID: dict[str, Coupling] = {"root": "rigid", "tip": "rigid"}
POINTS = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])


def tube(name: str = "tube") -> ShellMesh:
    """Octagonal tube along x."""
    angle = np.arange(8) * np.pi / 4.0
    ring = 0.05 * np.stack([np.zeros(8), np.cos(angle), np.sin(angle)], axis=1)
    nodes = np.concatenate([ring + np.array([x, 0.0, 0.0]) for x in np.linspace(0.0, 0.3, 5)])
    number = np.arange(40).reshape(5, 8)
    turned = np.roll(number, -1, axis=1)
    quads = np.stack([number[:-1], turned[:-1], turned[1:], number[1:]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([quads[:2, [0, 1, 2]], quads[:2, [0, 2, 3]]])
    thickness = np.full(4 + 30, 0.004)
    rings = {"root": number[0], "tip": number[-1]}
    return ShellMesh(name, nodes, triangles, quads[2:], thickness, 7e10, 0.3, rings)


@pytest.fixture
def store(tmp_path: Path) -> ArrayCache:
    return ArrayCache(tmp_path / "cache")


@pytest.fixture
def no_condensation(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """From the call on, whoever condenses a shell fails."""

    def refuse(*_: object) -> None:
        raise AssertionError("condensed again")

    return lambda: monkeypatch.setattr(link_cache, "shell_solution", refuse)


@pytest.fixture(autouse=True)
def _nothing_checked() -> None:
    """As in a new process."""
    link_cache._checked.clear()


def same_bits(a: Superelement, b: Superelement) -> bool:
    arrays = ("points", "stiffness", "flexibility")
    return (a.name, a.interfaces) == (b.name, b.interfaces) and all(
        getattr(a, x).tobytes() == getattr(b, x).tobytes() for x in arrays
    )


def agree(a: Superelement, b: Superelement) -> bool:
    """To round-off: a solver with threads adds up in another order each time."""
    scale = np.sqrt(np.diag(b.flexibility))
    return bool((np.abs(a.flexibility - b.flexibility) < 1e-9 * np.outer(scale, scale)).all())


def files(store: ArrayCache) -> list[Path]:
    assert store.folder is not None
    return list(store.folder.iterdir())


@pytest.mark.parametrize("kinds", [RIGID, {"root": "rigid", "tip": "distributing"}], ids=["rigid", "mixed"])
def test_a_hit_gives_the_same_bits(
    kinds: dict[str, Coupling], store: ArrayCache, no_condensation: Callable[[], None]
) -> None:
    first = cached_superelement(tube(), POINTS, kinds, store)
    assert agree(first, shell_superelement(tube(), POINTS, kinds))
    no_condensation()
    assert same_bits(cached_superelement(tube(), POINTS, kinds, store), first)
    # Names are the caller's: links that are alike share a file.
    twin = cached_superelement(tube("left"), POINTS, kinds, store)
    assert twin.name == "left"
    assert same_bits(replace(twin, name="tube"), first)
    with pytest.raises(AssertionError, match="condensed again"):
        cached_superelement(replace(tube(), youngs_modulus=7.1e10), POINTS, kinds, store)


def _moved(array: Array) -> Array:
    out = array.copy()
    out.flat[5] = np.nextafter(out.flat[5], np.inf)
    return out


def _key(mesh: ShellMesh | None = None, points: Array = POINTS, kinds: dict[str, Coupling] = RIGID) -> str:
    key = superelement_key(tube() if mesh is None else mesh, points, kinds)
    assert key is not None
    return key


def test_everything_that_decides_a_link_is_in_its_key() -> None:
    mesh = tube()
    rings = mesh.interfaces
    keys = [
        _key(),
        _key(replace(mesh, nodes=_moved(mesh.nodes))),
        _key(replace(mesh, thickness=_moved(mesh.thickness))),
        _key(replace(mesh, youngs_modulus=np.nextafter(7e10, 1e12))),
        _key(replace(mesh, poissons_ratio=0.29)),
        _key(replace(mesh, quads=np.roll(mesh.quads, 1, axis=0))),
        _key(replace(mesh, triangles=mesh.triangles[::-1])),
        _key(replace(mesh, interfaces={"root": rings["root"][:5], "tip": rings["tip"]})),
        _key(replace(mesh, interfaces={"tip": rings["tip"], "root": rings["root"]})),
        _key(replace(mesh, interfaces={"tip": rings["root"], "root": rings["tip"]})),
        _key(replace(mesh, interfaces={"root": rings["root"], "pin": rings["tip"]})),
        _key(points=_moved(POINTS)),
        _key(points=POINTS[::-1]),
        _key(kinds={"root": "distributing", "tip": "rigid"}),
        _key(kinds={"root": "rigid", "tip": "distributing"}),
        _key(kinds={"root": "distributing", "tip": "distributing"}),
    ]
    assert len(set(keys)) == len(keys)
    assert _key(tube("another name")) == _key()
    # How the numbers lie in memory does not matter.
    assert _key(replace(mesh, nodes=np.asfortranarray(mesh.nodes), quads=mesh.quads.astype(np.int32))) == _key()


@pytest.fixture
def _fresh_hash() -> Iterator[None]:
    formulation_hash.cache_clear()
    yield
    formulation_hash.cache_clear()


DECISIVE = {
    "fem.elements.condensation",
    "fem.elements.couplings",
    "fem.elements.shell",
    "fem.elements.assembly",
    "fem.elements.quad",
    "fem.elements.facets",
    "fem.elements.triangle",
}


@pytest.mark.slow
@pytest.mark.usefixtures("_fresh_hash")
def test_another_formulation_is_another_key(monkeypatch: pytest.MonkeyPatch) -> None:
    original, read = array_cache._source, set()

    def source(name: str) -> str:
        read.add(name)
        return original(name)

    monkeypatch.setattr(array_cache, "_source", source)
    keys = {_key()}
    # At least these; and not the modules that only use superelements.
    assert read >= DECISIVE
    assert not read & {"fem.statics.flexibility", "fem.statics.fields", "fem.model", "fem.elements.link_cache", "fem"}
    for changed in sorted(read):
        monkeypatch.setattr(array_cache, "_source", lambda name: original(name) + "\n" * (name == changed))  # noqa: B023
        formulation_hash.cache_clear()
        keys.add(_key())
    monkeypatch.setattr(array_cache, "_source", original)
    for name in ("FORMAT", "version"):
        with monkeypatch.context() as patch:
            if name == "FORMAT":
                patch.setattr(link_cache, name, "stiffarm-superelement/0")
            else:
                patch.setattr(array_cache, name, lambda _: "0.1")
            formulation_hash.cache_clear()
            keys.add(_key())
    assert len(keys) == 1 + len(read) + 2
    formulation_hash.cache_clear()
    assert _key() in keys


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("from fem.elements.beam import assemble", {"fem.elements.beam"}),
        ("def f():\n    import fem.elements.beam", {"fem.elements.beam"}),
        ("from fem.elements import beam", {"fem.elements", "fem.elements.beam"}),
        ("from fem import build_model, model", {"fem.model"}),
        ("import numpy.linalg, os\nfrom scipy.sparse import coo_array\nimport femto.second", set()),
    ],
)
def test_imports_are_found_however_they_are_written(text: str, found: set[str]) -> None:
    assert set(array_cache._imported(text, "fem")) == found


@pytest.mark.usefixtures("_fresh_hash")
def test_without_source_nothing_is_kept(store: ArrayCache, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str) -> str:
        raise OSError(name)

    monkeypatch.setattr(array_cache, "_source", refuse)
    element = cached_superelement(tube(), POINTS, RIGID, store)
    assert agree(element, shell_superelement(tube(), POINTS, RIGID))
    assert store.folder is not None
    assert not store.folder.exists()


def _wrong_contents(good: dict[str, Array], other: dict[str, Array]) -> dict[str, dict[str, Array]]:
    bent, infinite, lower = (good["flexibility"].copy() for _ in range(3))
    bent[2, 5] = np.nextafter(bent[2, 5], np.inf)
    infinite[3, 3] = np.inf
    lower[1, 5] = lower[5, 1] = 0.999 * lower[5, 1]
    f, u = good["flexibility"], good["solution"]
    return {
        "shapes": good | {"flexibility": np.eye(12)},
        "missing": {"flexibility": f},
        "spare": good | {"more": np.zeros(1)},
        "not finite": good | {"flexibility": infinite},
        "not symmetric": good | {"flexibility": bent},
        "negative": good | {"flexibility": -f},
        "another solution": good | {"solution": 1.001 * u},
        "half a solution": good | {"solution": u[: len(u) // 2]},
        # In equilibrium with one another, as a link of walls twice as thick or of another material would be.
        "scaled": {"flexibility": 2.0 * f, "solution": np.sqrt(2.0) * u},
        "one entry": good | {"flexibility": lower},
        "another link": other,
    }


@pytest.mark.parametrize("wrong", list(_wrong_contents(*[{"flexibility": np.eye(6), "solution": np.ones(3)}] * 2)))
def test_contents_that_are_no_such_link_are_built_again(
    wrong: str, store: ArrayCache, caplog: pytest.LogCaptureFixture
) -> None:
    """Under the right key and with the right checksum: nothing but the link's own equations tells."""
    element = cached_superelement(tube(), POINTS, RIGID, store)
    thicker = replace(tube(), thickness=1.1 * tube().thickness)
    cached_superelement(thicker, POINTS, RIGID, store)
    good, other = store.get(_key()), store.get(_key(thicker))
    assert good is not None
    assert other is not None
    store.put(_key(), _wrong_contents(good, other)[wrong])
    link_cache._checked.clear()
    assert agree(cached_superelement(tube(), POINTS, RIGID, store), element)
    assert len(caplog.records) == 1
    assert "is damaged" in caplog.text
    assert store.get(_key()) is not None
    assert len(files(store)) == 2


def test_equations_are_asked_once_a_process(store: ArrayCache, monkeypatch: pytest.MonkeyPatch) -> None:
    cached_superelement(tube(), POINTS, RIGID, store)
    link_cache._checked.clear()
    cached_superelement(tube(), POINTS, RIGID, store)
    monkeypatch.setattr(link_cache, "couple", lambda *_: pytest.fail("asked again"))
    cached_superelement(tube(), POINTS, RIGID, store)


def test_a_link_that_is_refused_is_not_kept(store: ArrayCache) -> None:
    for kinds in ({"root": "welded", "tip": "rigid"}, {"root": "rigid"}):
        refuses("L006", "'rigid' or 'distributing'", cached_superelement, tube(), POINTS, kinds, store)
    assert store.folder is not None
    assert not store.folder.exists()


# Models


def test_models_take_their_shells_from_the_cache(
    boom: Callable[..., ModelDescription],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    no_condensation: Callable[[], None],
) -> None:
    description = boom(length=0.15)
    monkeypatch.setenv("STIFFARM_CACHE", str(tmp_path))
    first = build_model(description, "shell")
    assert len(files(ArrayCache(tmp_path))) == 1
    no_condensation()
    # Springs and the rest of the arm have no part in a link.
    second = build_model(boom(length=0.15, stiffness=1e5), "shell")
    assert same_bits(first.links[0].element, second.links[0].element)
    for otherwise in ({"flanges": "distributing"}, {}):
        if not otherwise:
            monkeypatch.setenv("STIFFARM_CACHE", "off")
        with pytest.raises(AssertionError, match="condensed again"):
            build_model(description, "shell", **otherwise)  # type: ignore[arg-type]


def test_models_without_a_cache(
    boom: Callable[..., ModelDescription], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cached = build_model(boom(length=0.15), "shell").links[0].element
    monkeypatch.chdir(tmp_path)
    for place in ("off", "file/below"):
        (tmp_path / "file").touch()
        monkeypatch.setenv("STIFFARM_CACHE", place)
        assert agree(build_model(boom(length=0.15), "shell").links[0].element, cached)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_tests_stay_out_of_the_users_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = link_cache.user_cache().folder
    assert folder is not None
    assert tmp_path_factory.getbasetemp() in folder.parents
