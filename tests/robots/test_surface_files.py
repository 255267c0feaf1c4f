"""Prepared surfaces of links: found beside their model file, and carried along when the model is written elsewhere."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import pytest
from refusals import refuses

from robots import ModelDescription, content_hash, load_description, save_description
from robots.library.models import parse_description, to_toml
from robots.schema.description import Surface
from robots.schema.quantities import PositiveLength

WALL = PositiveLength(value=8, unit="mm", source="assumed")
SIZE = PositiveLength(value=30, unit="mm", source="assumed")


def with_surfaces(files: dict[str, Path]) -> ModelDescription:
    """The tx200 with surfaces on the named links."""
    description = load_description("tx200")
    links = []
    for link in description.link:
        if link.name in files:
            path = files[link.name]
            digest = hashlib.sha256(path.read_bytes()).hexdigest()
            surface = Surface(file=str(path), sha256=digest, wall=WALL, size=SIZE, source="assumed")
            link = link.model_copy(update={"surface": surface})
        links.append(link)
    return description.model_copy(update={"link": tuple(links)})


@pytest.fixture
def meshes(tmp_path: Path) -> dict[str, Path]:
    """Two files that stand for prepared surfaces, of two links of the tx200."""
    folder = tmp_path / "source"
    folder.mkdir()
    first, second, *_ = (link.name for link in load_description("tx200").link)
    for name in (first, second):
        (folder / f"{name}.bin").write_bytes(name.encode() * 100)
    return {name: folder / f"{name}.bin" for name in (first, second)}


def files(folder: Path) -> list[str]:
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())


def surfaces(description: ModelDescription) -> dict[str, Path]:
    return {link.name: Path(link.surface.file) for link in description.link if link.surface is not None}


def short(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:8]


def test_surfaces_travel_with_the_model(meshes: dict[str, Path], tmp_path: Path) -> None:
    given = with_surfaces(meshes)
    home, away = tmp_path / "home", tmp_path / "away"
    home.mkdir()
    save_description(given, home / "model.toml")
    expected = {name: f"meshes/{name}-{short(path)}.npz" for name, path in meshes.items()}
    assert files(home) == sorted([*expected.values(), "model.toml"])
    text = (home / "model.toml").read_text(encoding="utf-8")
    for name in expected.values():
        assert f'file = "{name}"' in text
    assert str(tmp_path) not in text
    shutil.rmtree(tmp_path / "source")
    # A folder moved as a whole, read from anywhere, written on to another one.
    home.rename(away)
    again = load_description(away / "model.toml")
    assert surfaces(again) == {name: away.resolve() / file for name, file in expected.items()}
    (tmp_path / "third").mkdir()
    save_description(again, tmp_path / "third" / "calibrated.toml")
    assert files(tmp_path / "third") == sorted(["calibrated.toml", *expected.values()])
    assert content_hash(again) == content_hash(given)


def test_a_path_from_here_is_read_from_the_models_folder(
    meshes: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "home").mkdir()
    save_description(with_surfaces(meshes), tmp_path / "home" / "model.toml")
    monkeypatch.chdir(tmp_path)
    found = surfaces(load_description("home/model.toml"))
    assert all(path.is_absolute() and path.is_file() for path in found.values())


def test_the_hash_sees_the_surface_but_not_where_it_lies(meshes: dict[str, Path], tmp_path: Path) -> None:
    given = with_surfaces(meshes)
    moved = {name: Path(shutil.copy(path, tmp_path)) for name, path in meshes.items()}
    assert content_hash(with_surfaces(moved)) == content_hash(given)
    first = next(iter(moved))
    moved[first].write_bytes(b"another mesh")
    assert content_hash(with_surfaces(moved)) != content_hash(given)
    assert content_hash(with_surfaces({})) != content_hash(given)


def test_equal_surfaces_are_kept_once(meshes: dict[str, Path], tmp_path: Path) -> None:
    """Two links with one mesh, and two models in one folder."""
    home = tmp_path / "home"
    home.mkdir()
    (first, path), (second, other) = meshes.items()
    shutil.copy(path, other)
    given = with_surfaces(meshes)
    save_description(given, home / "a.toml")
    shared = f"meshes/{first}-{short(path)}.npz"
    assert files(home) == ["a.toml", shared]
    written = (home / shared).stat()
    save_description(given, home / "b.toml")
    assert files(home) == ["a.toml", "b.toml", shared]
    assert (home / shared).stat().st_mtime_ns == written.st_mtime_ns
    assert set(surfaces(load_description(home / "b.toml"))) == {first, second}


def test_a_surface_that_is_gone_is_said_when_it_is_needed(meshes: dict[str, Path], tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    save_description(with_surfaces(meshes), home / "model.toml")
    shutil.rmtree(home / "meshes")
    again = load_description(home / "model.toml")
    refuses(
        "F001",
        r"surface file .* cannot be read .*import the link again",
        save_description,
        again,
        tmp_path / "copy.toml",
    )
    assert files(tmp_path) == sorted(["home/model.toml", *(f"source/{path.name}" for path in meshes.values())])


def test_a_surface_that_has_changed_is_refused_and_nothing_is_left(meshes: dict[str, Path], tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    given = with_surfaces(meshes)
    (*_, last) = meshes.values()
    last.write_bytes(b"edited")
    refuses("F007", "has changed since it was prepared", save_description, given, home / "model.toml")
    # The first link's copy was made already and is taken back, its folder too.
    assert list(home.iterdir()) == []


def test_another_file_under_the_name_is_never_overwritten(meshes: dict[str, Path], tmp_path: Path) -> None:
    home = tmp_path / "home"
    (home / "meshes").mkdir(parents=True)
    name, path = next(iter(meshes.items()))
    stranger = home / "meshes" / f"{name}-{short(path)}.npz"
    stranger.write_bytes(b"damaged")
    refuses("F009", "exists with other content", save_description, with_surfaces({name: path}), home / "model.toml")
    assert files(home) == [f"meshes/{stranger.name}"]
    assert stranger.read_bytes() == b"damaged"


def test_a_links_name_never_leads_out_of_the_folder(meshes: dict[str, Path], tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    name, path = next(iter(meshes.items()))
    given = with_surfaces({name: path})
    links = tuple(link.model_copy(update={"name": f"../../{link.name}"}) for link in given.link)
    save_description(given.model_copy(update={"link": links}), home / "model.toml")
    assert len(files(home)) == 2
    assert {p.parent for p in surfaces(load_description(home / "model.toml")).values()} == {home.resolve() / "meshes"}


def test_the_text_of_a_model_needs_no_files(meshes: dict[str, Path]) -> None:
    given = with_surfaces(meshes)
    for path in meshes.values():
        path.unlink()
    assert parse_description(to_toml(given), "text") == given
