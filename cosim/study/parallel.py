"""Where the runs of a study are made: threads of this machine, or workers of a dask scheduler."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

from ..errors import CosimError, InputError
from ..master.cores import cores
from ..spec.distribution import way_out
from .compute import RunnerPool, TaskResult, compute, lost
from .planning import Found, Group, Task

if TYPE_CHECKING:
    from distributed import Client

Keep = Callable[[Task, TaskResult], None]
Told = Callable[[str], None]
ANSWER = 10.0
"""Time within which a scheduler must answer [s]."""
INTERRUPTED = 0.2
"""Time within which it is known that an interruption ended an isolated run [s]."""
AHEAD = 4
"""Runs that are handed to a scheduler per thread of its workers, before results come back."""


class _Stopped(Exception):
    """The study ends while this run is under way."""


def in_threads(
    tasks: Iterable[Task], pool: RunnerPool, workers: int, keep: Keep, told: Told
) -> None:
    """Make runs in threads.

    The compiled executor releases the interpreter lock, so runs of FMUs take as many cores as there
    are threads.

    Args:
        tasks: what to run; taken one by one.
        pool: gives instances.
        workers: threads.
        keep: called in the thread with each result.
        told: called after that in the calling thread, with what the run was made with.

    Raises:
        KeyboardInterrupt: and runs under way are given up; those that are finished are kept.
    """
    waiting, lock, stop = iter(tasks), threading.Lock(), threading.Event()
    events: queue.SimpleQueue[str | BaseException | None] = queue.SimpleQueue()

    def check(_: float) -> None:
        if stop.is_set():
            raise _Stopped

    def work() -> None:
        try:
            while not stop.is_set():
                with lock:
                    task = next(waiting, None)
                if task is None:
                    break
                outcome = compute(task, pool, check)
                failed = outcome.result["status"] != "ok"
                if failed and pool.isolate is not None and stop.wait(INTERRUPTED):
                    break  # Ctrl-C goes to the processes of isolated runs, too
                keep(task, outcome)
                events.put(task.label)
        except _Stopped:
            pass
        except BaseException as error:
            events.put(error)
        finally:
            events.put(None)

    threads = [threading.Thread(target=work, name=f"study-{i}") for i in range(workers)]
    running = 0
    try:
        for thread in threads:
            thread.start()
            running += 1
        while running:
            try:
                event = events.get(timeout=0.5)  # endless waiting cannot be interrupted everywhere
            except queue.Empty:
                continue
            if event is None:
                running -= 1
            elif isinstance(event, BaseException):
                raise event
            else:
                told(event)
    finally:
        stop.set()
        for thread in threads:
            if thread.ident is not None:
                thread.join()
        pool.close()


# -- dask ------------------------------------------------------------------------------------------

_pools: dict[tuple[str, float | None], RunnerPool] = {}
_pools_lock = threading.Lock()


def _pool(study: str, provider: Found, isolate: float | None) -> RunnerPool:
    """The pool of a worker process; that of an earlier study is freed."""
    with _pools_lock:
        if (study, isolate) not in _pools:
            for pool in _pools.values():
                pool.close()
            _pools.clear()
            _pools[study, isolate] = RunnerPool(provider, cores(), isolate)
        return _pools[study, isolate]


def _remote(
    study: str, group: Group, provider: Found, isolate: float | None, task: dict[str, Any]
) -> TaskResult:
    """One run on a worker."""
    return compute(Task(group=group, **task), _pool(study, provider, isolate))


def _same(group: Group) -> Group:
    return group


def on_scheduler(
    tasks: Iterable[Task],
    address: str,
    provider: Found,
    isolate: float | None,
    study: str,
    keep: Keep,
    told: Told,
) -> None:
    """Make runs on the workers of a dask scheduler; results are kept here.

    Workers need the same version of cosim, and must reach the FMUs under the same paths.

    Args:
        tasks: what to run.
        address: of the scheduler, e.g. `tcp://host:8786`.
        provider: where the FMUs are.
        isolate: as of `GroupRunner`.
        study: a text that no other study has.
        keep: called with each result.
        told: called after that, with what the run was made with.

    Raises:
        InputError: dask is not installed, or the scheduler does not answer.
    """
    try:
        from distributed import Client
    except ModuleNotFoundError as error:
        raise InputError(
            f"--scheduler needs {error.name}, which is not installed: {way_out('study')}"
        ) from error
    try:
        client = Client(address, timeout=ANSWER)
    except (OSError, ValueError) as error:  # TimeoutError is an OSError
        raise InputError(
            f"scheduler {address}: does not answer ({error}); start one with 'dask scheduler' and "
            "workers with 'dask worker ADDRESS'"
        ) from error
    with client:
        _on_client(client, iter(tasks), provider, isolate, study, keep, told)


def _on_client(
    client: Client,
    waiting: Iterator[Task],
    provider: Found,
    isolate: float | None,
    study: str,
    keep: Keep,
    told: Told,
) -> None:
    from distributed import KilledWorker, as_completed

    threads = sum(client.nthreads().values())
    if not threads:
        raise InputError(
            f"scheduler {client.scheduler.address}: has no workers; start some with "
            "'dask worker ADDRESS'"
        )
    sent: dict[Group, Any] = {}
    under_way: dict[str, Task] = {}

    def submit() -> Any:
        task = next(waiting, None)
        if task is None:
            return None
        if task.group not in sent:
            for group in [g for g in sent if g not in {t.group for t in under_way.values()}]:
                del sent[group]
            # a task, because what is scattered is lost with the worker that holds it
            sent[task.group] = client.submit(_same, task.group, pure=False)
        content = {
            "key": task.key, "point": task.point, "reference": task.reference,
            "designed": task.designed, "notes": task.notes,
        }  # fmt: skip
        future = client.submit(
            _remote, study, sent[task.group], provider, isolate, content, pure=False
        )
        under_way[future.key] = task
        return future

    first = [future for future in (submit() for _ in range(AHEAD * threads)) if future is not None]
    results = as_completed(first)
    for future in results:
        task = under_way.pop(future.key)
        try:
            outcome = future.result()
        except KilledWorker as error:
            outcome = lost(task, f"the workers that made this run died, the last on {error}")
        if not isinstance(outcome, TaskResult):
            raise CosimError(f"{task.label}: a worker gave {outcome!r}; is it of this version?")
        keep(task, outcome)
        told(task.label)
        following = submit()
        if following is not None:
            results.add(following)
