"""Many pieces of work side by side: in processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import copy_context
from typing import Any

from stablepush.core.children import work_under
from stablepush.core.errors import InputError
from stablepush.core.scratch import scratch_folder

#: Threads at most: what is not compiled takes turns.
_MOST_THREADS = 4
#: How many ask for one thread of BLAS, and what takes it back.
_LOCK, _within = threading.Lock(), 0
_limits: Any = None


def run_parallel(
    function: Callable[..., Any],
    jobs: Iterable[tuple[Any, ...]],
    processes: int | None = 1,
    *,
    scheduler: str | None = None,
    in_order: bool = True,
) -> Iterator[Any]:
    """Return an iterator over ``function(*job)`` of every job, as it is found; what is found does not depend on where.

    Leaving the loop early, or Ctrl-C, ends the work.

    Parameters
    ----------
    function : callable
        With arguments and result that can be pickled. It leaves its arguments as they are, and takes its seed from them.
    jobs : iterable of tuple
    processes : int or None
        Of this machine; None is one for each core. 1 is this process, several use one thread each for linear algebra.
    scheduler : str, optional
        Address of a Dask cluster, ``tcp://host:8786``, whose workers do all of it instead (extra ``scale``). They need the same
        version of the library.
    in_order : bool
        Whether results come in the order of the jobs; else as soon as they are there.

    Raises
    ------
    InputError
        Fewer than one process, or no such cluster. Errors of the function are passed on.
    """
    if processes is not None and processes < 1:
        raise InputError("processes", "expected at least 1", processes)
    work = list(jobs)
    if scheduler is not None:
        return _on_cluster(function, work, _client(scheduler), in_order)
    if processes == 1 or len(work) < 2:
        return (function(*job) for job in work)
    return _in_processes(function, work, processes or -1, in_order)


def _in_processes(function: Callable[..., Any], jobs: list[tuple[Any, ...]], processes: int, in_order: bool) -> Iterator[Any]:
    import joblib

    order = "generator" if in_order else "generator_unordered"
    # inherited by the workers: they do not look for modules in the current folder
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
        # arrays are copied, not shared
        pool = joblib.Parallel(n_jobs=processes, return_as=order, max_nbytes=None)
    stack = ExitStack()
    scratch = str(stack.enter_context(scratch_folder()))
    results = pool(joblib.delayed(work_under)(os.getpid(), scratch, function, *job) for job in jobs)
    try:
        for result in results:  # noqa: UP028 (closed below, not by "yield from")
            yield result
    finally:
        with warnings.catch_warnings():
            # that work is given up is what whoever leaves early wants
            warnings.simplefilter("ignore")
            results.close()
        stack.close()
        if before is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = before


def _client(scheduler: str) -> Any:
    try:
        from dask.distributed import Client
    except ImportError:
        raise InputError("scheduler", 'a Dask cluster needs the extra "scale": pip install "stablepush[scale]"') from None
    try:
        return Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise InputError("scheduler", f"no Dask cluster answers at {scheduler!r}: {error}") from None


def _on_cluster(function: Callable[..., Any], jobs: list[tuple[Any, ...]], client: Any, in_order: bool) -> Iterator[Any]:
    from dask.distributed import as_completed

    with client:
        # the same call twice is two pieces of work: it may write a file, or take time
        futures = [client.submit(function, *job, pure=False) for job in jobs]
        try:
            for future in futures if in_order else as_completed(futures):
                yield future.result()
        finally:
            client.cancel(futures)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread, for products of small matrices, until the last of those that asked for it at once has left.

    Its threads gain nothing there, and wait for each other by spinning: beside another busy process a diagnosis took 15 times as
    long.
    """
    global _within, _limits  # noqa: PLW0603 (the library's threads are those of the process)
    from threadpoolctl import threadpool_limits

    with _LOCK:
        _within += 1
        if _limits is None:
            _limits = threadpool_limits(limits=1, user_api="blas")
    try:
        yield
    finally:
        with _LOCK:
            _within -= 1
            if not _within:
                _limits.restore_original_limits()
                _limits = None


def usable_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_threads(function: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
    """Return what a function returns of each item, side by side in threads: for compiled code, which releases the interpreter.

    An error of the function, or Ctrl-C, ends the work and is raised here, when no thread works any more.
    """
    count = min(_MOST_THREADS, usable_cores(), len(items))
    if count < 2:
        return [function(item) for item in items]
    results: list[Any] = [None] * len(items)
    # whoever is free takes the next row; a step of this iterator is never shared
    rows, stopped = iter(range(len(items))), threading.Event()
    errors: dict[int, BaseException] = {}

    def work() -> None:
        while not stopped.is_set() and (row := next(rows, None)) is not None:
            try:
                results[row] = function(items[row])
            except BaseException as error:
                errors[row] = error
                stopped.set()

    # each with the settings of this one, as those of numpy
    others = [threading.Thread(target=copy_context().run, args=(work,), daemon=True) for _ in range(count - 1)]
    try:
        for other in others:
            other.start()
        # this thread works as well: another one would only wait for the interpreter
        work()
    except BaseException:
        # Ctrl-C outside of the function
        stopped.set()
        raise
    finally:
        for other in others:
            if other.ident is not None:
                other.join()
    # an interrupt comes before errors of the function
    for row in sorted(errors, key=lambda row: (isinstance(errors[row], Exception), row)):
        raise errors[row]
    return results
