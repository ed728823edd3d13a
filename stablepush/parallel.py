"""Many pieces of work side by side: in processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from stablepush.errors import InputError


def run_parallel(
    function: Callable[..., Any],
    jobs: Iterable[tuple[Any, ...]],
    processes: int | None = 1,
    *,
    scheduler: str | None = None,
    in_order: bool = True,
) -> Iterator[Any]:
    """Yield ``function(*job)`` of every job as it is found; what is found does not depend on where.

    Leaving the loop early, or Ctrl-C, ends the work.

    Parameters
    ----------
    function : callable
        With arguments and result that can be pickled; it takes its seed from its arguments.
    jobs : iterable of tuple
    processes : int or None
        Of this machine; None is one for each core, 1 is this process. Each uses one thread for linear algebra.
    scheduler : str, optional
        Address of a Dask cluster, ``tcp://host:8786``, that does the work instead (extra ``scale``). Its workers need the same
        version of the library.
    in_order : bool
        Whether results come in the order of the jobs; else as soon as they are there.

    Raises
    ------
    InputError
        Fewer than one process, or no such cluster. Errors of the function are passed on.
    """
    if processes is not None and processes < 1:
        raise InputError(f"processes: expected at least 1, got {processes}")
    import joblib

    calls = [joblib.delayed(function)(*job) for job in jobs]
    if not calls:
        return
    with _engine(processes, scheduler):
        order = "generator" if in_order else "generator_unordered"
        # arrays are copied, for workers may write into them
        results = joblib.Parallel(n_jobs=processes or -1, return_as=order, max_nbytes=None)(calls)
        try:
            for result in results:  # noqa: UP028 (closed below, not by "yield from")
                yield result
        finally:
            with warnings.catch_warnings():
                # that work is given up is what whoever leaves early wants
                warnings.simplefilter("ignore")
                results.close()


@contextmanager
def _engine(processes: int | None, scheduler: str | None) -> Iterator[None]:
    import joblib

    if scheduler is None:
        if processes == 1:
            yield
            return
        with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
            yield
        return
    try:
        from dask.distributed import Client
    except ImportError:
        raise InputError('a Dask cluster needs the extra "scale": pip install "stablepush[scale]"') from None
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler: no Dask cluster answers at {scheduler!r}: {error}") from None
    with client, joblib.parallel_config(backend="dask"):
        yield
