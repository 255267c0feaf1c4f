"""Maps made block by block: of any size, in any order, interrupted and gone on with, in little memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from map_arms import engine, kr60

from robots import InputError
from surrogate.maps.assembled import counts, figures, map_data
from surrogate.maps.blocks import Engine, run_blocks
from surrogate.maps.layouts import joint_layout, slice_layout
from surrogate.maps.poses import BestGamma
from surrogate.maps.store import Column, MapStore

ROOT = Path(__file__).resolve().parents[3]
UP = np.array([0.0, 0.0, 1.0])
WANTED = ("stiffness", "isotropy", "softest", "singular")


def sweep(points: int = 6) -> Engine:
    robot = kr60().robot
    names = robot.coordinates
    return engine(
        kr60(), joint_layout(robot, names[1:3], points, {names[4]: [30.0, -60.0]}), wanted=WANTED, shares=True
    )


def plane() -> Engine:
    grid = slice_layout("xz", np.arange(0.0, 2001.0, 200.0), np.arange(0.0, 1001.0, 250.0))
    return engine(kr60(), grid, BestGamma(UP, np.zeros(1)), wanted=WANTED, shares=True)


def store_of(made: Engine, folder: Path, size: int, key: str = "k") -> MapStore:
    return MapStore(folder, key, made.grid.n, size, made.columns)


@pytest.mark.parametrize("made", [sweep(), plane()], ids=["joints", "slice"])
def test_blocks_of_any_size_in_any_order_make_the_same_map(made: Engine, tmp_path: Path) -> None:
    whole = made.block(slice(0, made.grid.n))
    assert 0 < np.count_nonzero(whole["reached"]) <= made.grid.n
    for size in (7, 1000):
        store = store_of(made, tmp_path / str(size), size)
        for number in reversed(store.missing()):
            store.write(number, made.block(store.rows(number)))
        for name, values in store.finished().items():
            # Blocks of other lengths are summed in another order.
            np.testing.assert_allclose(values, whole[name], rtol=1e-11, atol=1e-14, err_msg=name)


def test_a_map_of_a_store_has_all_it_needs(tmp_path: Path) -> None:
    made = plane()
    store = store_of(made, tmp_path / "work", 16)
    seen: list[tuple[int, int]] = []
    run_blocks(made, store, lambda done, total: seen.append((done, total)))
    assert seen[-1] == (store.n, store.n)
    data = map_data(made, store.finished(), {"robot": "kr60-3"})
    assert isinstance(data.points.base, np.memmap) or isinstance(data.points, np.memmap)
    assert list(data.fields) == [
        "stiffness_N_per_mm",
        "isotropy",
        "softest_part",
        "softest_part_share",
        "jacobian_smallest_singular_value",
        "near_singular",
    ]
    lost = ~np.asarray(data.reached)
    assert lost.any()
    assert np.isnan(data.fields["stiffness_N_per_mm"].values[lost]).all()
    assert (np.asarray(data.fields["softest_part"].values)[lost] == -1.0).all()
    assert data.fields["softest_part"].categories == data.parts
    assert data.shares is not None
    np.testing.assert_allclose(np.asarray(data.shares)[~lost].sum(axis=1), 1.0, atol=1e-6)  # single precision
    of = figures(data.fields["stiffness_N_per_mm"].values)
    values = np.asarray(data.fields["stiffness_N_per_mm"].values)
    assert of is not None
    assert (of.count, of.least, of.greatest) == (np.count_nonzero(data.reached), np.nanmin(values), np.nanmax(values))
    assert of.median == np.nanmedian(values)
    assert values[of.row_of_greatest] == of.greatest
    assert counts(data.fields["softest_part"].values, len(data.parts)).sum() == np.count_nonzero(data.reached)
    assert figures(np.full(3, np.nan)) is None


def test_an_interrupted_map_goes_on_where_it_was(tmp_path: Path) -> None:
    made = sweep()
    first = store_of(made, tmp_path / "work", 11)
    for number in (0, 3, 4):
        first.write(number, made.block(first.rows(number)))
    with (tmp_path / "work" / "done.txt").open("a") as file:
        file.write("5 0")  # the process died in the middle of this line
    second = store_of(made, tmp_path / "work", 11)
    assert set(second.done) == {0, 3, 4}
    assert 5 in second.missing()
    run_blocks(made, second)
    third = store_of(made, tmp_path / "work", 11)
    assert third.missing() == []
    whole = made.block(slice(0, made.grid.n))
    for name, values in third.finished().items():
        np.testing.assert_allclose(values, whole[name], rtol=1e-11, atol=1e-14, err_msg=name)


def flipped(path: Path, place: int) -> None:
    """The file with one bit changed."""
    with path.open("r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ 0x40]))


@pytest.mark.slow
def test_one_flipped_bit_in_a_block_is_noticed_and_made_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A map once had a maximum of 27,019 instead of 18,827 N/mm by one."""
    made, work = sweep(), tmp_path / "work"
    store = store_of(made, work, 11)
    run_blocks(made, store)
    before = {name: np.array(values) for name, values in store.finished().items()}
    sizes = {name: values.nbytes for name, values in before.items()}
    for name in before:  # in each array, in its first, last and some middle block
        for place in (0, sizes[name] // 2, sizes[name] - 1):
            caplog.clear()
            flipped(work / f"{name}.npy", store.starts[name] + place)
            again = store_of(made, work, 11)
            assert len(again.missing()) == 1
            assert "1 of " in caplog.text
            assert "made again" in caplog.text
            run_blocks(made, again)
            assert store_of(made, work, 11).missing() == []
    for name, values in again.finished().items():
        np.testing.assert_array_equal(values, before[name], err_msg=name)


@pytest.mark.parametrize("damage", ["bit", "swapped", "nonsense", "beyond", "not ascii"])
def test_a_damaged_record_costs_blocks_never_a_number(tmp_path: Path, damage: str) -> None:
    made, work = sweep(), tmp_path / "work"
    run_blocks(made, store_of(made, work, 11))
    lines = (work / "done.txt").read_bytes().split(b"\n")
    if damage == "bit":
        lines[1] = bytes([lines[1][0] ^ 1]) + lines[1][1:]  # block 1 becomes block 0
    elif damage == "swapped":
        numbers, hashes = zip(*(line.split() for line in lines[:2]), strict=True)
        lines[:2] = [numbers[0] + b" " + hashes[1], numbers[1] + b" " + hashes[0]]
    else:
        lines[1] = {"nonsense": b"x", "beyond": b"99 " + lines[1][2:], "not ascii": b"\xff"}[damage]
    (work / "done.txt").write_bytes(b"\n".join(lines))
    again = store_of(made, work, 11)
    assert set(again.missing()) == ({0, 1} if damage in ("bit", "swapped") else {1})
    run_blocks(made, again)
    assert store_of(made, work, 11).missing() == []


def test_blocks_are_looked_at_before_the_map_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    made = sweep()
    store = store_of(made, tmp_path / "work", 11)
    times: list[int] = []

    def spoiling(often: int) -> None:
        run_blocks(made, store)
        times.append(len(times))
        if len(times) <= often:
            flipped(tmp_path / "work" / "q.npy", store.starts["q"] + 100)

    store.complete(lambda: spoiling(1))
    assert len(times) == 2
    assert "blocks are damaged (0)" in caplog.text
    np.testing.assert_array_equal(store.finished()["q"], made.block(slice(0, store.n))["q"])
    times.clear()
    store.done.clear()
    with pytest.raises(InputError, match="other than they were written"):
        store.complete(lambda: spoiling(99))


def test_a_folder_begun_and_left_before_its_record_is_begun_anew(tmp_path: Path) -> None:
    made = sweep()
    store_of(made, tmp_path / "work", 11)
    (tmp_path / "work" / "work.json").unlink()
    assert store_of(made, tmp_path / "work", 11).done == {}


def test_folders_of_something_else_are_refused(tmp_path: Path) -> None:
    made = sweep()
    store_of(made, tmp_path / "work", 11)
    with pytest.raises(InputError, match="of another map"):
        store_of(made, tmp_path / "work", 11, key="other")
    with pytest.raises(InputError, match="of another map"):
        store_of(made, tmp_path / "work", 12)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("precious")
    with pytest.raises(InputError, match="holds other files"):
        store_of(made, tmp_path / "other", 11)
    assert (tmp_path / "other" / "thesis.txt").read_text() == "precious"
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="work folder"):
        store_of(made, tmp_path / "file", 11)
    with pytest.raises(InputError, match="space for the map"):
        MapStore(tmp_path / "large", "k", 10**15, 11, {"a": Column("<f8")})


def test_blocks_of_another_map_are_refused(tmp_path: Path) -> None:
    made = sweep()
    store = store_of(made, tmp_path / "work", 11)
    block = made.block(store.rows(0))
    with pytest.raises(InputError, match=r"block 1 of the map: isotropy.*missing"):
        store.write(1, {name: values for name, values in block.items() if name != "isotropy"})
    with pytest.raises(InputError, match=r"block 1 of the map: q"):
        store.write(1, block | {"q": np.zeros((11, 5))})
    assert store.done == {}
    with pytest.raises(InputError, match="blocks are missing"):
        store.finished()


_LARGE = """
import resource, sys
sys.path[:0] = [{root!r}, {here!r}]
from pathlib import Path
from map_arms import engine, kr60
from surrogate.maps.blocks import run_blocks
from surrogate.maps.layouts import joint_layout
from surrogate.maps.store import MapStore
robot = kr60().robot
made = engine(kr60(), joint_layout(robot, robot.coordinates[1:4], int(sys.argv[1])), wanted=("stiffness", "worst"))
run_blocks(made, MapStore(Path(sys.argv[2]), "k", made.grid.n, made.points_a_block, made.columns))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_map(tmp_path: Path) -> None:
    code = _LARGE.format(root=str(ROOT), here=str(Path(__file__).parent))
    used = []
    for points in (40, 126):  # 64 thousand and 2 million
        run = [sys.executable, "-c", code, str(points), str(tmp_path / str(points))]
        out = subprocess.run(run, capture_output=True, text=True, check=True)  # noqa: S603 - our own interpreter
        used.append(int(out.stdout) / 1024)
    # The arrays of 2 million points are 180 MB; what is needed is some blocks of 16384.
    assert used[1] < used[0] + 40.0
