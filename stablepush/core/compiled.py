"""How inner loops are compiled."""

from __future__ import annotations

import hashlib
import pickle
import shutil
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from numba import njit, types
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher

from stablepush.core.build_lock import BuildLock
from stablepush.core.collecting import without_collecting
from stablepush.core.first_build import announce_build

#: Multiply-adds may be fused, which only makes them more accurate; nothing else of fast maths, for NaN must stay NaN. Threads may
#: run compiled code side by side: it touches nothing but its arguments.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}, "no_cfunc_wrapper": True, "nogil": True}

#: The events of building a function, and of waiting for another process that does.
_BUILDING, _WAITING = "numba:compile", "stablepush:waiting"


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile on first call; keep the machine code on disk unless no place can be written.

    A constant argument is an argument like others: a tuple of different types cannot be indexed by it.
    """
    return _kept(njit(**_OPTIONS)(function))  # type: ignore[no-any-return]


def inner(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that only compiled code may call: without the door to Python, which takes long to build.

    Calling it from Python crashes the process.
    """
    return _kept(njit(no_cpython_wrapper=True, **_OPTIONS)(function))  # type: ignore[no-any-return]


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function of compiled code into each of its callers: what is a constant there unrolls its loops."""
    return njit(no_cpython_wrapper=True, inline="always", **_OPTIONS)(function)  # type: ignore[no-any-return]


def _kept(dispatcher: Any) -> Any:
    if hasattr(dispatcher, "_cache"):  # not if compiling is turned off
        template = dispatcher.get_call_template

        def one_for_all_values(args: Any, kws: Any) -> Any:
            # numba would build the function again for each constant that it is called with
            return template(tuple(map(types.unliteral, args)), {name: types.unliteral(kind) for name, kind in kws.items()})

        dispatcher.get_call_template = one_for_all_values
        # numba found neither the package nor the user's cache folder writable: no code is kept then
        with suppress(RuntimeError):
            cache = dispatcher._cache = _Cache(dispatcher.py_func)
            build = dispatcher._compiler.compile

            def build_or_release(args: Any, return_type: Any) -> Any:
                with cache.lock.released_on_error(), without_collecting():
                    return build(args, return_type)

            dispatcher._compiler.compile = build_or_release
    return dispatcher


def is_cached(function: Any) -> bool:
    """Tell whether the machine code of a compiled function is kept on disk."""
    return isinstance(getattr(function, "_cache", None), _Cache)


class _Files(IndexDataCacheFile):  # type: ignore[misc]
    """Data is written before the index that refers to it, under a name that no other source or signature has: whoever reads while
    another process writes, or was killed, finds the right code or none."""

    def save(self, key: Any, data: Any) -> None:
        name = self._data_name(zlib.crc32(repr((self._source_stamp, key)).encode()))
        self._save_data(name, data)
        self._save_index(self._load_index() | {key: name})

    # Both kinds of file begin with a checksum, of their name, too: what a disk or a kill has spoilt, or has another's name, is
    # not unpickled, let alone run, but built again.

    def _load_index(self) -> dict[Any, str]:
        found = self._read(Path(self._index_path))
        stamp, version, names = found if found is not None else (None, None, {})
        return names if (stamp, version) == (self._source_stamp, self._version) else {}

    def _save_index(self, names: dict[Any, str]) -> None:
        self._write(Path(self._index_path), (self._source_stamp, self._version, names))

    def _load_data(self, name: str) -> Any:
        found = self._read(Path(self._data_path(name)))
        if found is None:
            # as numba has it for a file that is not there
            raise FileNotFoundError(name)
        return found

    def _save_data(self, name: str, data: Any) -> None:
        self._write(Path(self._data_path(name)), data)

    def _write(self, path: Path, value: Any) -> None:
        content = self._dump(value)
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        with self._open_for_write(str(path)) as file:
            file.write(_checksum(path, content) + content)

    def _read(self, path: Path) -> Any:
        """The value of a file; None if none can be read, if it is not as it was written, or has types of another version."""
        size = hashlib.sha256().digest_size
        with suppress(OSError, AttributeError, ImportError):
            # a pipe would be waited for
            content = path.read_bytes() if path.is_file() else b""
            if _checksum(path, content[size:]) == content[:size]:
                return pickle.loads(content[size:])
        return None


def _checksum(path: Path, content: bytes) -> bytes:
    return hashlib.sha256(path.name.encode() + content).digest()


class _Cache(FunctionCache):  # type: ignore[misc]
    """Machine code on disk, not used once a file has changed from which a function comes that it calls: numba itself looks at the
    function's own file only. Processes do not build the same function at the same time."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _Files(self.cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())
        self.lock = BuildLock(self.cache_path, f"{function.__module__}.{function.__qualname__}")

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        return (*super()._index_key(sig, codegen), _stamps(self._py_func))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = super().load_overload(sig, target_context)
        if found is None and not self.lock.held:
            announce_build()
            with event.trigger_event(_WAITING):
                self.lock.acquire()
            with self.lock.released_on_error():
                found = super().load_overload(sig, target_context)
            if found is not None:
                self.lock.release()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        # a disk that is full: the code is built again next time
        try:
            with suppress(OSError):
                super().save_overload(sig, data)
        finally:
            self.lock.release()


def _stamps(function: Any) -> tuple[tuple[str, int, int], ...]:
    """Name, time of change (ns) and size of the other files that a function's compiled helpers come from."""
    files: set[str] = set()
    todo, seen = [function], {function.__module__}
    while todo:
        for value in todo.pop().__globals__.values():
            helper = getattr(value, "py_func", None) if isinstance(value, Dispatcher) else None
            if helper is not None and helper.__module__ not in seen:
                seen.add(helper.__module__)
                files.add(helper.__code__.co_filename)
                todo.append(helper)
    stats = [(Path(name).name, Path(name).stat()) for name in sorted(files)]
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)


class _Builds(event.Listener):  # type: ignore[misc]
    """Tells of each function that is built, None for a wait for another process, and the time in s of the outermost of nested
    builds."""

    def __init__(self, began: Callable[[Any], None], ended: Callable[[float], None]) -> None:
        self._tell_start, self._tell_end, self._depth, self._began = began, ended, 0, 0.0

    def on_start(self, started: Any) -> None:
        if self._depth == 0:
            self._began = time.perf_counter()
        self._depth += 1
        self._tell_start(None if started.data is None else started.data["dispatcher"])

    def on_end(self, _: Any) -> None:
        # whoever listens from within a build hears of its end only
        self._depth = max(0, self._depth - 1)
        if self._depth == 0:
            self._tell_end(time.perf_counter() - self._began)


def watch_builds(began: Callable[[Any], None], ended: Callable[[float], None]) -> None:
    """Call ``began`` with each function that is built from now on, with None if another process is waited for, and ``ended`` with
    the time in s when that is over."""
    listener = _Builds(began, ended)
    for kind in (_BUILDING, _WAITING):
        event.register(kind, listener)


@contextmanager
def when_built(notify: Callable[[float], None]) -> Iterator[None]:
    """Call ``notify`` with the time in s whenever code was built in the block, here or by another process that was waited for."""
    listener = _Builds(lambda _: None, notify)
    with event.install_listener(_BUILDING, listener), event.install_listener(_WAITING, listener):
        yield
