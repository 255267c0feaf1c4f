"""Maps made block by block: in any order, interrupted and gone on with; what is damaged is made again."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cluster_work
import numpy as np
import oracles
import pytest
from cluster_work import SIZE
from map_arms import box_layout, cylinder_layout, engine, kr60, planar, slice_layout
from refusals import refuses

from robots import InputError
from surrogate.maps import cluster
from surrogate.maps.blocks import Engine
from surrogate.maps.cluster import run_on
from surrogate.maps.data import figures
from surrogate.maps.layouts import joint_layout, points_of, poses_of, range_for, reach_of, step_for
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


# ------------------------------------------------------------
# Blocks made by a Dask cluster of processes: the same as here, also when a worker is killed; errors in plain words

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def workers() -> Iterator[Any]:
    """Two worker processes that see this folder's modules."""
    distributed = oracles.load("distributed")
    before = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = os.pathsep.join([str(HERE), str(HERE.parents[2]), before])
    try:
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
        ) as made:
            yield made
    finally:
        os.environ["PYTHONPATH"] = before


def store_in(folder: Path) -> MapStore:
    made = cluster_work.made()
    return MapStore(made.grid.n, SIZE, made.columns, "k", folder)


def same(one: MapStore, other: MapStore) -> bool:
    mine, theirs = one.finished(), other.finished()
    return all(mine[name].tobytes() == theirs[name].tobytes() for name in mine)


@pytest.mark.slow
def test_a_cluster_makes_the_same_map_though_a_worker_is_killed(workers: Any, tmp_path: Path) -> None:
    here, there = store_in(tmp_path / "here"), store_in(tmp_path / "there")
    cluster_work.made().computed(store=here)
    assert np.count_nonzero(here.finished()["reached"]) > SIZE
    pids = [worker.pid for worker in workers.workers.values()]
    killed: list[int] = []

    def kill_one(done: int, total: int) -> None:
        if done > total // 4 and not killed:
            os.kill(pids[0], signal.SIGKILL)
            killed.append(done)

    run_on(workers.scheduler_address, cluster_work.slowly, "0.2", there, kill_one)
    assert killed
    assert killed[0] < there.n
    assert same(here, there)


@pytest.mark.slow
def test_what_a_cluster_made_before_it_was_lost_is_gone_on_with_here(workers: Any, tmp_path: Path) -> None:
    half, whole = store_in(tmp_path / "half"), store_in(tmp_path / "whole")

    def stop(done: int, total: int) -> None:
        if done > total // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_on(workers.scheduler_address, cluster_work.slowly, "0", half, stop)
    again = store_in(tmp_path / "half")
    assert 0 < len(again.missing()) < again.blocks
    cluster_work.made().computed(store=again)
    cluster_work.made().computed(store=whole)
    assert same(again, whole)


@pytest.mark.slow
def test_what_workers_refuse_or_cannot_do_is_said(workers: Any, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"worker says: map request: version: got '0\.0'"):
        run_on(workers.scheduler_address, cluster_work.refusing, "0.0", store_in(tmp_path / "a"))
    with pytest.raises(InputError, match=r"No module named 'stiffarm'.*install the same version"):
        run_on(workers.scheduler_address, cluster_work.failing, "", store_in(tmp_path / "b"))


@pytest.mark.slow
def test_a_scheduler_without_workers_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = oracles.load("distributed")
    monkeypatch.setattr(cluster, "FIRST_WORKER_s", 0.5)
    with (
        distributed.LocalCluster(n_workers=0, processes=True, dashboard_address=":0") as empty,
        pytest.raises(InputError, match="no workers"),
    ):
        run_on(empty.scheduler_address, cluster_work.slowly, "0", store_in(tmp_path / "a"))


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense://x", "", "tcp://127.0.0.1"])
def test_an_address_at_which_nobody_answers_is_refused_within_seconds(address: str, tmp_path: Path) -> None:
    oracles.load("distributed")
    store = store_in(tmp_path / "a")
    start = time.monotonic()
    refuses("S014", "does not answer", run_on, address, cluster_work.slowly, "0", store)
    # It asked for ever.
    assert time.monotonic() - start < 60.0


def test_without_the_library_its_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    refuses(
        "F013", r"stiffarm\[dask\]", run_on, "tcp://127.0.0.1:9", cluster_work.slowly, "0", store_in(tmp_path / "a")
    )


# ------------------------------------------------------------
# Layouts of maps: where their points are, in which order, and what is refused

ALL = slice(None)


def test_a_box_runs_along_x_fastest() -> None:
    grid = box_layout([0.0, 10.0, 20.0], [5.0], [1.0, 2.0])
    assert [axis.name for axis in grid.axes] == ["z", "y", "x"]
    wanted = [[x, 5.0, z] for z in (1.0, 2.0) for x in (0.0, 10.0, 20.0)]
    np.testing.assert_allclose(points_of(grid, ALL), 1e-3 * np.array(wanted), atol=1e-15)


@pytest.mark.parametrize(("plane", "held"), [("xz", 1), ("yz", 0), ("xy", 2)])
def test_a_slice_holds_the_third_coordinate(plane: str, held: int) -> None:
    grid = slice_layout(plane, [0.0, 10.0, 20.0], [100.0, 300.0], at_mm=7.0)
    p = 1e3 * points_of(grid, ALL)
    first, second = ("xyz".index(letter) for letter in plane)
    np.testing.assert_allclose(p[:, held], 7.0)
    np.testing.assert_allclose(p[:, first], [0, 10, 20, 0, 10, 20], atol=1e-12)
    np.testing.assert_allclose(p[:, second], [100] * 3 + [300] * 3)


def test_a_cylinder_is_about_the_z_axis() -> None:
    grid = cylinder_layout([0.0, 500.0], np.arange(-180.0, 181.0, 90.0), [100.0])
    p = points_of(grid, ALL).reshape(5, 2, 3)
    np.testing.assert_allclose(p[:, 0], [[0.0, 0.0, 0.1]] * 5, atol=1e-15)
    np.testing.assert_allclose(p[3, 1], [0.0, 0.5, 0.1], atol=1e-15)
    np.testing.assert_allclose(p[0, 1], p[-1, 1], atol=1e-15)


def test_rows_are_worked_out_alone() -> None:
    grid = box_layout(range_for(-1000, 1000, 10), range_for(-1000, 1000, 14), range_for(0, 2000, 20))
    assert grid.n > 1_000_000
    rows = slice(777_777, 777_787)
    np.testing.assert_array_equal(points_of(grid, rows), points_of(grid, slice(700_000, 800_000))[77_777:77_787])


def test_joint_sweeps_have_their_layers_first_and_the_other_joints_at_zero() -> None:
    robot = kr60().robot
    names = robot.coordinates
    grid = joint_layout(robot, names[1:3], 3, {names[3]: [-90.0, 0.0]})
    assert (grid.layers, grid.shape) == (1, (2, 3, 3))
    q = poses_of(grid, robot, ALL)
    assert (q[:, [0, 4, 5]] == 0.0).all()
    np.testing.assert_allclose(np.degrees(q[:9, 3]), -90.0)
    np.testing.assert_allclose(q[:3, 2], [*robot.limits[2, :1], robot.limits[2].mean(), robot.limits[2, 1]], atol=1e-12)


def test_reach_of_a_planar_arm() -> None:
    reach = reach_of(planar().robot)
    # The stretched arm is 0.9 m long; a sample comes within some thousandths of that.
    assert 0.895 < reach.radius <= 0.9 + 1e-12
    np.testing.assert_allclose(reach.upper[:2], 0.9, atol=5e-3)


def test_default_steps_are_round_and_give_the_points_asked_for() -> None:
    for length in np.geomspace(3.0, 30_000.0, 50):
        step = step_for(length, 40)
        assert 40 <= length / step <= 100
        assert f"{step:.0e}"[0] in "125" or step / 10 ** np.floor(np.log10(step)) == pytest.approx(2.5)
    np.testing.assert_allclose(range_for(-12.0, 31.0, 10.0), [-20, -10, 0, 10, 20, 30, 40])


def test_what_is_refused() -> None:
    robot = kr60().robot
    refuses("S011", "evenly spaced", box_layout, [0.0, 1.0, 3.0], [0.0], [0.0])
    refuses("S011", "evenly spaced", slice_layout, "xz", [0.0, -1.0], [0.0])
    refuses("S011", "radius", cylinder_layout, [-1.0, 0.0], [0.0], [0.0])
    refuses("S011", "at most one turn", cylinder_layout, [1.0], [0.0, 200.0, 400.0], [0.0])
    refuses("B001", "finite", box_layout, [np.nan], [0.0], [0.0])
    refuses("S011", "points of the map", box_layout, np.arange(2000.0), np.arange(2000.0), np.arange(2000.0))
    refuses("S011", "each once", joint_layout, robot, robot.coordinates[1:3], 3, {robot.coordinates[1]: [0.0]})
    refuses("B003", "q9_deg", joint_layout, robot, ["q9_deg"], 3)
