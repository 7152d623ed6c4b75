"""Work on a Dask cluster: its scheduler gives tasks to workers, and those of a worker that dies to another one.

The workers run the same version of this package, see the recordings under the same paths, and hand the results back:
they need no folder to write to.
"""

import asyncio
import logging
import queue
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from savgs_ident.cli.supervised import Lost
from savgs_ident.core.errors import InputError

if TYPE_CHECKING:
    from distributed import Client, Future

Task = TypeVar("Task")
Result = TypeVar("Result")

ANSWER_S = 5.0
"""How long a scheduler may take to answer, and to have a worker [s]."""

LONELY_S = 60.0
"""How long a cluster may be without any worker in the middle of the work [s]."""

_LOOK_S = 0.5


def on_cluster(
    address: str, work: Callable[[Task], Result], tasks: Sequence[Task], lonely_s: float = LONELY_S
) -> Iterator[tuple[int, Result | Lost]]:
    """Numbers of tasks and what ``work``, defined at the top of a module, made of them, as they come.

    A task that the cluster gives up, or that is left when there was no worker for ``lonely_s`` [s] or no scheduler
    any more, is :class:`Lost`. Raises :class:`InputError` if Dask is not installed, or the scheduler does not answer
    or has no worker.
    """
    with _connected(address) as client:
        done: queue.SimpleQueue[tuple[int, Future[Any]]] = queue.SimpleQueue()
        run = uuid.uuid4().hex
        futures = {
            number: client.submit(work, task, key=f"savgs-ident-{run}-{number}", pure=False)
            for number, task in enumerate(tasks)
        }
        for number, future in futures.items():
            future.add_done_callback(lambda future, number=number: done.put((number, future)))
        seen = time.monotonic()
        while futures:
            try:
                number, future = done.get(timeout=_LOOK_S)
            except queue.Empty:
                seen = time.monotonic() if _has_workers(client) else seen
                if time.monotonic() - seen > lonely_s:
                    break
                continue
            seen = time.monotonic()
            del futures[number]
            yield number, _result_of(future, address)
        for number in futures:
            yield number, Lost(f"the cluster at {address} had no worker left")


def _result_of(future: "Future[Any]", address: str) -> Any:
    if future.status == "cancelled":
        return Lost(f"the connection to the cluster at {address} was lost")
    try:
        return future.result(timeout=LONELY_S)
    except Exception as error:
        return Lost(f"{type(error).__name__}: {' '.join(str(error).split())}")


def _has_workers(client: "Client") -> bool:
    return client.status == "running" and bool(client.scheduler_info().get("workers"))


@contextmanager
def _connected(address: str) -> Iterator["Client"]:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(
            "Dask is not installed", source="--scheduler", remedy="pip install 'savgs-ident[cluster]'"
        ) from error
    # What matters is told in our words.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    until = time.monotonic() + ANSWER_S
    while not _asked(address).get("workers"):
        if time.monotonic() > until:
            raise _no_answer(address, "has no worker")
        time.sleep(_LOOK_S)
    with Client(address, timeout=ANSWER_S, set_as_default=False) as client:
        yield client


def _asked(address: str) -> dict[str, Any]:
    """What a scheduler says of itself. A client would wait for ever for what takes a connection and says nothing."""
    from distributed import Security, rpc

    async def ask() -> dict[str, Any]:
        async with rpc(address, connection_args=Security().get_connection_args("client")) as scheduler:
            said: dict[str, Any] = await scheduler.identity()
            return said

    try:
        return dict(asyncio.run(asyncio.wait_for(ask(), ANSWER_S)))
    except Exception as error:
        # An address may be wrong in many ways, and what answers there may be no scheduler at all.
        raise _no_answer(address, "does not answer") from error


def _no_answer(address: str, what: str) -> InputError:
    return InputError(
        f"the Dask scheduler at {address} {what}",
        source="--scheduler",
        remedy="start `dask scheduler` and `dask worker ADDRESS`, and give the address that it tells",
    )
