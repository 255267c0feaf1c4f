"""Maps made block by block: in any order, interrupted and gone on with; what is damaged is made again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from map_arms import engine, kr60, slice_layout
from refusals import refuses

from surrogate.maps.blocks import Engine
from surrogate.maps.data import figures
from surrogate.maps.layouts import joint_layout
from surrogate.maps.poses import BestGamma
from surrogate.maps.store import MapStore

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
    return MapStore(made.grid.n, size, made.columns, key, folder)


def run_blocks(made: Engine, store: MapStore) -> None:
    made.computed(store=store)


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
    data = made.computed({"robot": "kr60-3"}, lambda done, total: seen.append((done, total)), store)
    assert seen[-1] == (store.n, store.n)
    assert data.metadata == {"robot": "kr60-3"}
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
    assert figures(np.full(3, np.nan)) is None


def test_an_interrupted_map_goes_on_where_it_was(tmp_path: Path) -> None:
    made = sweep()
    first = store_of(made, tmp_path / "work", 11)
    for number in (0, 3, 4):
        first.write(number, made.block(first.rows(number)))
    (tmp_path / "work" / ".0123456789ab.tmp.npz").write_bytes(b"PK")  # the process died in the middle of block 5
    second = store_of(made, tmp_path / "work", 11)
    assert second.done == {0, 3, 4}
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


def test_one_flipped_bit_in_a_block_is_noticed_and_made_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A map once had a maximum of 27,019 instead of 18,827 N/mm by one."""
    made, work = sweep(), tmp_path / "work"
    store = store_of(made, work, 11)
    run_blocks(made, store)
    before = {name: np.array(values) for name, values in store.finished().items()}
    for block in sorted(work.glob("*.npz"))[:2]:
        for place in range(0, block.stat().st_size, 1009):
            caplog.clear()
            flipped(block, place)
            again = store_of(made, work, 11)
            if again.missing():
                assert f"1 of {again.blocks} blocks are damaged ({int(block.stem[-6:])}); they are made" in caplog.text
                run_blocks(made, again)
            else:  # a bit of no number: a date, or a gap
                flipped(block, place)
            for name, values in again.finished().items():
                np.testing.assert_array_equal(values, before[name], err_msg=f"{name} {place}")


@pytest.mark.parametrize("damage", ["cut off", "nonsense", "of another block", "empty"])
def test_a_damaged_block_is_made_again(tmp_path: Path, damage: str) -> None:
    made, work = sweep(), tmp_path / "work"
    run_blocks(made, store_of(made, work, 11))
    first, second = sorted(work.glob("*.npz"))[:2]
    whole = first.read_bytes()
    said = {"cut off": whole[:-30], "nonsense": b"x", "of another block": second.read_bytes(), "empty": b""}
    first.write_bytes(said[damage])
    again = store_of(made, work, 11)
    assert again.missing() == [0]
    run_blocks(made, again)
    np.testing.assert_array_equal(again.finished()["q"], made.computed().q)
    assert store_of(made, work, 11).missing() == []


def test_a_folder_begun_and_left_before_its_record_is_begun_anew(tmp_path: Path) -> None:
    made = sweep()
    store_of(made, tmp_path / "work", 11)
    (tmp_path / "work" / "work.json").unlink()
    assert store_of(made, tmp_path / "work", 11).done == set()


def test_folders_of_something_else_are_refused(tmp_path: Path) -> None:
    made = sweep()
    store_of(made, tmp_path / "work", 11)
    refuses("S013", "of another map", store_of, made, tmp_path / "work", 11, key="other")
    refuses("S013", "of another map", store_of, made, tmp_path / "work", 12)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("precious")
    refuses("S013", "holds other files", store_of, made, tmp_path / "other", 11)
    assert (tmp_path / "other" / "thesis.txt").read_text() == "precious"
    (tmp_path / "file").write_text("")
    refuses("S013", "work folder", store_of, made, tmp_path / "file", 11)


def test_blocks_of_another_map_are_refused(tmp_path: Path) -> None:
    made = sweep()
    store = store_of(made, tmp_path / "work", 11)
    block = made.block(store.rows(0))
    refuses(
        "S013",
        r"block 1 of the map: isotropy.*missing",
        store.write,
        1,
        {name: values for name, values in block.items() if name != "isotropy"},
    )
    refuses("S013", r"block 1 of the map: q", store.write, 1, block | {"q": np.zeros((11, 5))})
    assert store.done == set()
    refuses("S013", "blocks are missing", store.finished)
