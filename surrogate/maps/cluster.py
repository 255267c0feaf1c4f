"""Blocks of a map made by a Dask cluster: plain text goes out, arrays come back and are stored as they arrive.

What is sent is the name of a function that the workers have installed too, the request as text and the number of a
block. Dask itself packs such calls with pickle, so a scheduler is to be trusted like the machine it runs on.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots import InputError
from robots.lazily import optional
from robots.progress import Progress, report_progress
from surrogate.maps.store import MapStore

Answer = Mapping[str, Any]
Work = Callable[[str, int], Answer]

# Seconds for the scheduler to answer, for a first worker to be there, and without any worker before giving up.
CONNECT_s, FIRST_WORKER_s, PATIENCE_s = 5.0, 20.0, 120.0
# Blocks under way for each thread of the cluster: so many results may wait at once.
AHEAD = 2
# Times that a block may be lost together with its worker before the block itself is suspected.
LOSSES = 4
# Key of an answer that holds a message instead of arrays.
REFUSED = "refused"


def run_on(address: str, work: Work, request: str, store: MapStore, progress: Progress | None = None) -> None:
    """Have the blocks that a store lacks made by the workers of a scheduler.

    Parameters
    ----------
    address : as in ``tcp://host:8786``
    work : request text and number of a block -> arrays of :meth:`MapStore.write`, or ``{REFUSED: message}``; a
        function of a module that workers can import

    A block whose worker dies is made again by another; what is stored stays, whatever happens afterwards.

    Raises
    ------
    InputError
        Dask is missing, nobody answers at the address, there are no workers, or a worker refuses the request (another
        version, another model) or cannot do it.
    """
    distributed = optional("distributed", "maps on a cluster", "dask")
    client = _client(distributed, address)
    try:
        _workers(client, address)
        with client.as_current():
            _run(distributed, client, work, request, store, progress)
    finally:
        client.close(timeout=CONNECT_s)


def _run(distributed: Any, client: Any, work: Work, request: str, store: MapStore, progress: Progress | None) -> None:
    waiting, losses = store.missing(), dict.fromkeys(store.missing(), 0)
    under_way: dict[Any, int] = {}
    seen = time.monotonic()
    try:
        while waiting or under_way:
            threads = sum(client.nthreads().values())
            seen = time.monotonic() if threads else seen
            while waiting and len(under_way) < max(1, AHEAD * threads):
                number = waiting.pop(0)
                under_way[client.submit(work, request, number, pure=False)] = number
            for future in _finished(distributed, under_way):
                number = under_way.pop(future)
                if _lost(distributed, future):
                    losses[number] += 1
                    if losses[number] > LOSSES:
                        raise InputError(
                            f"block {number} of the map",
                            code="S014",
                            value=f"lost with its worker {losses[number]} times",
                            allowed="workers that live as long as a block takes",
                            remedy="give them more memory (see the workers' logs)",
                        )
                    waiting.insert(0, number)
                    continue
                store.write(number, _arrays(future, number))
                future.release()
                report_progress(progress, store.points_done, store.n)
            if time.monotonic() - seen > PATIENCE_s:
                raise InputError(
                    "Dask cluster",
                    code="S014",
                    value=f"no worker for {PATIENCE_s:g} s; {store.blocks - len(store.missing())} of {store.blocks} "
                    "blocks are done",
                    remedy="start workers and run again with the same work folder",
                )
    finally:
        client.cancel(list(under_way))


def _finished(distributed: Any, under_way: Mapping[Any, int]) -> list[Any]:
    """Those that are done, waiting for the first of them, but not for ever."""
    if not under_way:
        time.sleep(0.1)
        return []
    try:
        return list(distributed.wait(list(under_way), timeout=2.0, return_when="FIRST_COMPLETED").done)
    except (TimeoutError, distributed.TimeoutError):
        return []
    except distributed.CancelledError:  # some of them, with the worker or the scheduler that had them
        return [future for future in under_way if future.status in ("cancelled", "lost")]


def _lost(distributed: Any, future: Any) -> bool:
    """Whether a block went down with its worker."""
    if future.status in ("cancelled", "lost"):
        return True
    return future.status == "error" and isinstance(future.exception(), distributed.scheduler.KilledWorker)


def _arrays(future: Any, number: int) -> dict[str, NDArray[np.generic]]:
    if future.status == "error":
        error = future.exception()
        missing = isinstance(error, ImportError | AttributeError)
        raise InputError(
            f"block {number} of the map failed on a worker ({type(error).__name__}: {error})",
            code="S014",
            remedy="install the same version of stiffarm, with what it needs, on the workers" if missing else None,
        )
    answer = future.result()
    if REFUSED in answer:
        raise InputError(f"the cluster's worker says: {answer[REFUSED]}", code="S014")
    return {name: np.asarray(values) for name, values in answer.items()}


def _client(distributed: Any, address: str) -> Any:
    try:
        # First by hand: a client that finds nobody goes on trying in the background when it has been given up.
        host, _, port = address.rpartition("://")[2].rpartition(":")
        socket.create_connection((host.strip("[]"), int(port)), CONNECT_s).close()
        return distributed.Client(address, timeout=CONNECT_s, set_as_default=False, name="stiffarm map")
    # Whoever else answers there may say anything: lengths that no memory holds, other protocols.
    except (OSError, TimeoutError, ValueError, OverflowError, MemoryError, RuntimeError) as error:
        raise InputError(
            f"Dask scheduler at {address!r} does not answer ({type(error).__name__})",
            code="S014",
            allowed="the address of a running scheduler, as in tcp://host:8786",
            remedy="start one (`dask scheduler`), check the address and the firewall",
        ) from None


def _workers(client: Any, address: str) -> None:
    until = time.monotonic() + FIRST_WORKER_s
    while not client.nthreads():
        if time.monotonic() > until:
            raise InputError(
                f"Dask scheduler at {address}",
                code="S014",
                value="no workers",
                remedy=f"start some: `dask worker {address}` where stiffarm is installed",
            )
        time.sleep(0.2)
