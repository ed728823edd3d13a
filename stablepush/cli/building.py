"""Code is compiled at first use: progress of that, and processes that help on other cores."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from stablepush.cli.common import Progress, told
from stablepush.core import BuildLock, UnavailableError, end_with_parent, start_child, usable_cores

#: Processes that help, at most: more would only wait for each other.
_MOST_HELPERS = 3
#: Helpers start at the first function if its folder keeps no code at all, else at the fifth: a changed file is no first use.
_MANY = 5

#: Helpers, and the right to start them. Both are needed until this process ends.
_running: list[object] = []


def build_all() -> None:
    """Build the compiled code now.

    It is the code of plans, simulated pushes, fits and diagnoses. Otherwise it is built at first use, which then takes up to a
    minute longer. It is kept beside the package, or in the user's cache if that cannot be written.
    """
    from stablepush.core import compiled, is_cached

    # a function of this package: those of other folders are kept likewise
    if not is_cached(compiled(lambda: None)):
        raise UnavailableError("no compiled code is kept: expected a folder that can be written, and NUMBA_DISABLE_JIT not set")
    started = time.perf_counter()
    for part in reversed(_PARTS):
        part()
    told(seconds=round(time.perf_counter() - started, 1))
    print(f"compiled code is ready ({time.perf_counter() - started:.1f} s)")


class FirstUse:
    """A line of progress while code is built, and processes that help: for the moment of the first build."""

    def __init__(self) -> None:
        from stablepush.core import watch_builds

        self._line = Progress("first use: compiling for this machine, once")
        self._count = 0
        watch_builds(self._began, lambda _: self._line.__exit__())

    def _began(self, built: Any) -> None:
        if built is None:
            self._line.describe("waiting for another process that does it")
        elif (built.py_func.__module__ or "").startswith("stablepush"):
            self._count += 1
            self._line.describe(f"function {self._count}, {built.py_func.__name__.strip('_')}")
            if self._count == _MANY or (self._count == 1 and not _keeps_code(built)):
                _start_helpers(built)


def _keeps_code(built: Any) -> bool:
    """Tell whether the folder for a function's code has code of any function."""
    from stablepush.core import is_cached

    return is_cached(built) and any(Path(built._cache.cache_path).glob("*.nbi"))


def _start_helpers(built: Any) -> None:
    from stablepush.core import is_cached

    if _running or not is_cached(built):
        return
    # held until this process ends: if another one has started helpers, they build for this one as well
    lock = BuildLock(built._cache.cache_path, "helpers")
    lock.acquire(timeout=0.0)
    if lock.held:
        _running.append(lock)
        for first in range(min(usable_cores() - 1, _MOST_HELPERS)):
            with suppress(OSError):  # without help it takes longer
                # it builds, from another part on, until it is done or this process ends
                helper = start_child("stablepush.cli.building", [str(first)])
                helper.stdin.write("\n")
                helper.stdin.flush()
                _running.append(helper)


def _rollouts() -> None:
    from stablepush.demo import CONTACT_FRICTION, demo_slider, demo_truth
    from stablepush.mechanics import Pusher, simulate_push
    from stablepush.objects import PushContact

    slider = demo_slider()
    contact = PushContact.on_edge(slider, 0, 0.05, 0.05, CONTACT_FRICTION)
    pusher = Pusher.of_contact(contact)
    motion = [((0.01, 0.0, 0.0), 0.01)]
    simulate_push(demo_truth(), slider, pusher, contact.mu, (0.0, 0.0, 0.0), pusher.docked(contact), motion)


def _plans() -> None:
    from stablepush.demo import demo_pokes, demo_scene
    from stablepush.identify import fit_limit_surface
    from stablepush.planning import plan

    loads, twists, _ = demo_pokes(12).pairs()
    plan(demo_scene(fit_limit_surface(loads, twists).surface), time_limit=60.0)


def _fits() -> None:
    from stablepush.demo import demo_pokes
    from stablepush.identify import fit_limit_surface

    pokes = demo_pokes(12)
    fit_limit_surface(*pokes.pairs()[:2], slider=pokes.rig.slider)


def _diagnoses() -> None:
    from stablepush.demo import demo_pokes
    from stablepush.diagnosis import diagnose

    diagnose(demo_pokes(12))


#: What a helper goes through, each from another place on: a function that somebody else builds is waited for.
_PARTS: tuple[Callable[[], object], ...] = (_rollouts, _plans, _diagnoses, _fits)


if __name__ == "__main__":
    end_with_parent()
    from_part = int(sys.argv[1])
    for work in _PARTS[from_part:] + _PARTS[:from_part]:
        work()
    # without waiting for the thread that reads
    os._exit(0)
