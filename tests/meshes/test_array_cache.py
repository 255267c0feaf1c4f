"""The folder of named arrays: bit for bit or not at all, whatever happens to its files."""

from __future__ import annotations

import hashlib
import io
import logging
import multiprocessing
import os
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from meshes import array_cache
from meshes.array_cache import ArrayCache, user_cache
from robots.arrays import Array

KEY = hashlib.sha256(b"a link").hexdigest()
OTHER = hashlib.sha256(b"another").hexdigest()


@pytest.fixture
def arrays(rng: np.random.Generator) -> dict[str, Array]:
    return {"stiffness": rng.normal(size=(18, 18)), "points": np.array([[0.0, -0.0, 1e-308]]), "none": np.zeros((0, 3))}


@pytest.fixture
def cache(tmp_path: Path) -> ArrayCache:
    return ArrayCache(tmp_path / "cache")


def file_of(cache: ArrayCache, key: str = KEY) -> Path:
    assert cache.folder is not None
    return cache.folder / f"{key}.arrays"


def same_bits(a: dict[str, Array] | None, b: dict[str, Array]) -> bool:
    return (
        a is not None
        and list(a) == list(b)
        and all(a[k].shape == b[k].shape and a[k].tobytes() == b[k].tobytes() for k in b)
    )


def test_what_is_put_comes_back_bit_for_bit(cache: ArrayCache, arrays: dict[str, Array]) -> None:
    assert cache.get(KEY) is None
    cache.put(KEY, arrays)
    assert same_bits(cache.get(KEY), arrays)
    assert cache.get(OTHER) is None
    cache.put(KEY, {"x": np.ones(3)})
    assert same_bits(cache.get(KEY), {"x": np.ones(3)})
    assert [path.name for path in file_of(cache).parent.iterdir()] == [f"{KEY}.arrays"]


def _flipped(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


def _whole(npz: bytes) -> bytes:
    """A file of the cache's own form, key, checksum and all, around any bytes."""
    return array_cache._head(KEY, npz) + npz


def _pickled(_: bytes) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, stiffness=np.array([{"a": 1}], dtype=object))
    return _whole(buffer.getvalue())


def _lone_array(_: bytes) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.ones(3))
    return _whole(buffer.getvalue())


def _no_arrays(_: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("stiffness.npy", b"\x93NUMPY\x01\x00 not a header")
    return _whole(buffer.getvalue())


@pytest.mark.parametrize(
    "damage",
    [
        _flipped,
        lambda content: content[:-1],
        lambda content: content[: len(content) // 2],
        lambda content: content[:20],
        lambda _: b"",
        lambda content: content + b"\0",
        lambda content: content[50:],
        lambda _: b"\x80\x04N.",
        _pickled,
        _lone_array,
        _no_arrays,
        lambda _: _whole(b""),
    ],
    ids=[
        "a bit flipped",
        "last byte gone",
        "half",
        "head",
        "empty",
        "longer",
        "no head",
        "a pickle",
        "pickled object",
        "lone array",
        "no header",
        "no content",
    ],
)
def test_a_damaged_file_is_absent_and_removed_with_one_remark(
    cache: ArrayCache, arrays: dict[str, Array], damage: object, caplog: pytest.LogCaptureFixture
) -> None:
    cache.put(KEY, arrays)
    path = file_of(cache)
    path.write_bytes(damage(path.read_bytes()))  # type: ignore[operator]
    with caplog.at_level(logging.WARNING):
        assert cache.get(KEY) is None
        assert not path.exists()
        assert cache.get(KEY) is None
    assert [record.name for record in caplog.records] == ["stiffarm"]
    assert "damaged" in caplog.text
    assert str(path) in caplog.text
    cache.put(KEY, arrays)
    assert same_bits(cache.get(KEY), arrays)


def test_every_flipped_bit_is_noticed(cache: ArrayCache) -> None:
    cache.put(KEY, {"x": np.arange(3.0)})
    path = file_of(cache)
    content = path.read_bytes()
    for i in range(len(content)):
        path.write_bytes(content[:i] + bytes([content[i] ^ (1 << (i % 8))]) + content[i + 1 :])
        assert cache.get(KEY) is None


def test_the_content_of_another_key_is_damaged(cache: ArrayCache, caplog: pytest.LogCaptureFixture) -> None:
    """Two springs once took each other's values so."""
    cache.put(KEY, {"u": np.array([1.0])})
    cache.put(OTHER, {"u": np.array([2.0])})
    one, other = file_of(cache).read_bytes(), file_of(cache, OTHER).read_bytes()
    file_of(cache).write_bytes(other)
    file_of(cache, OTHER).write_bytes(one)
    assert cache.get(KEY) is None
    assert cache.get(OTHER) is None
    assert caplog.text.count("that of another key") == 2
    # Only the name in the head set right: the checksum is over both.
    file_of(cache).write_bytes(other.replace(OTHER.encode(), KEY.encode()))
    assert cache.get(KEY) is None
    assert "its checksum does not match" in caplog.text


def test_what_the_owner_finds_wrong_is_damaged(
    cache: ArrayCache, arrays: dict[str, Array], caplog: pytest.LogCaptureFixture
) -> None:
    cache.put(KEY, arrays)
    assert cache.get(KEY, lambda found: f"{len(found)} arrays") is None
    assert "(3 arrays)" in caplog.text
    assert not file_of(cache).exists()


def test_no_cache(tmp_path: Path, arrays: dict[str, Array], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for value in ("off", "OFF", " off "):
        monkeypatch.setenv("STIFFARM_CACHE", value)
        assert user_cache() == ArrayCache(None)
    user_cache().put(KEY, arrays)
    assert user_cache().get(KEY) is None
    assert list(tmp_path.iterdir()) == []


def test_where_the_cache_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STIFFARM_CACHE", str(tmp_path / "own"))
    assert user_cache().folder == tmp_path / "own"
    monkeypatch.setenv("STIFFARM_CACHE", "~/own")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    assert user_cache().folder == tmp_path / "own"
    monkeypatch.setenv("STIFFARM_CACHE", "")
    folder = user_cache().folder
    assert folder is not None
    assert folder.is_absolute()
    assert "stiffarm" in folder.parts


@pytest.mark.skipif(sys.platform == "win32", reason="no such users there")
@pytest.mark.parametrize("chosen", ["", "~/own"])
def test_without_a_home_there_is_no_cache(chosen: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As for a user that the system does not know, in a container say: nothing is written here under the name "~"."""

    def unknown(number: int) -> None:
        raise KeyError(number)

    monkeypatch.setattr("pwd.getpwuid", unknown)
    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("STIFFARM_CACHE", chosen)
    assert user_cache() == ArrayCache(None)
    monkeypatch.setattr(array_cache.platformdirs, "user_cache_path", lambda *_, **__: Path("~/.cache/stiffarm"))
    assert user_cache() == ArrayCache(None)


@pytest.mark.parametrize("key", ["", "x", "../../" + KEY, KEY.upper(), KEY + "0"])
def test_a_key_is_a_hash(cache: ArrayCache, key: str) -> None:
    for use in (lambda: cache.get(key), lambda: cache.put(key, {})):
        with pytest.raises(ValueError, match="SHA-256"):
            use()


def test_a_folder_that_cannot_be_used_is_no_cache(
    tmp_path: Path, arrays: dict[str, Array], caplog: pytest.LogCaptureFixture
) -> None:
    taken = tmp_path / "file"
    taken.write_text("no folder", encoding="utf-8")
    caplog.set_level(logging.DEBUG, "stiffarm")
    for cache in (ArrayCache(taken), ArrayCache(taken / "below")):
        caplog.clear()
        for key in (KEY, OTHER):
            cache.put(key, arrays)
            assert cache.get(key) is None
        # Said quietly, and not once for each link.
        assert {record.levelno for record in caplog.records} == {logging.DEBUG}
        assert len({record.getMessage() for record in caplog.records}) == len(caplog.records) <= 2
    assert taken.read_text(encoding="utf-8") == "no folder"


def _refuse(*_: object, **__: object) -> None:
    raise PermissionError(13, "Permission denied")


def test_a_read_only_folder(cache: ArrayCache, arrays: dict[str, Array], monkeypatch: pytest.MonkeyPatch) -> None:
    cache.put(KEY, arrays)
    with monkeypatch.context() as patch:  # root may write anywhere, so access rights are no test
        patch.setattr(Path, "write_bytes", _refuse)
        cache.put(OTHER, arrays)
    assert cache.get(OTHER) is None
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", _refuse)
        cache.put(OTHER, arrays)
    assert cache.get(OTHER) is None
    assert same_bits(cache.get(KEY), arrays)
    assert len(list(file_of(cache).parent.iterdir())) == 1  # no temporary file stays
    # A damaged file that cannot be removed is still not used.
    path = file_of(cache)
    path.write_bytes(_flipped(path.read_bytes()))
    monkeypatch.setattr(Path, "unlink", _refuse)
    assert cache.get(KEY) is None


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_write_access(cache: ArrayCache, arrays: dict[str, Array]) -> None:
    cache.put(KEY, arrays)
    folder = file_of(cache).parent
    folder.chmod(0o500)
    try:
        cache.put(OTHER, arrays)
        assert cache.get(OTHER) is None
        assert same_bits(cache.get(KEY), arrays)
    finally:
        folder.chmod(0o700)


def test_an_interrupted_write_leaves_nothing(
    cache: ArrayCache, arrays: dict[str, Array], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        cache.put(KEY, arrays)
    assert list(file_of(cache).parent.iterdir()) == []


def test_the_folder_stays_small(cache: ArrayCache, monkeypatch: pytest.MonkeyPatch, arrays: dict[str, Array]) -> None:
    monkeypatch.setattr(array_cache, "MOST_FILES", 3)
    keys = [hashlib.sha256(bytes([i])).hexdigest() for i in range(5)]
    cache.put(keys[0], arrays)
    folder = file_of(cache).parent
    fresh, stale = (folder / f".{letter * 12}.tmp.arrays" for letter in "ab")
    foreign = folder / "notes.txt"
    for path in (fresh, stale, foreign):
        path.touch()
    os.utime(stale, (0, 0))
    os.utime(foreign, (0, 0))
    for i, key in enumerate(keys):
        cache.put(key, arrays)
        os.utime(file_of(cache, key), (1e9 + i, 1e9 + i))
    assert {path.name for path in folder.iterdir()} == {
        fresh.name,
        foreign.name,
        *(f"{key}.arrays" for key in keys[2:]),
    }


def _use(folder: str, seed: int, rounds: int) -> None:
    """A process that reads, damages and writes one key; whatever it reads is whole."""
    cache, expected = ArrayCache(Path(folder)), {"x": np.arange(2_000.0)}
    logging.getLogger("stiffarm").setLevel(logging.ERROR)
    for i in range(rounds):
        found = cache.get(KEY)
        if found is not None and not same_bits(found, expected):
            raise AssertionError("half a file was read")
        if (i + seed) % 7 == 3:
            file_of(cache).write_bytes(b"damaged by process " + bytes([seed]))
        cache.put(KEY, expected)


@pytest.mark.slow
def test_several_processes_at_once(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    workers = [context.Process(target=_use, args=(str(tmp_path), seed, 30)) for seed in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(120)
    assert [worker.exitcode for worker in workers] == [0, 0]
    assert same_bits(ArrayCache(tmp_path).get(KEY), {"x": np.arange(2_000.0)})
    assert [path.suffix for path in tmp_path.iterdir()] == [".arrays"]
