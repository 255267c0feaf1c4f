"""Blocks made by a Dask cluster of processes: the same as here, also when a worker is killed; errors in plain words."""

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
from refusals import refuses

from robots import InputError
from surrogate.maps import cluster
from surrogate.maps.cluster import run_on
from surrogate.maps.store import MapStore

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
