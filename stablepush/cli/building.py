"""Compiled code is built at first use: said to whoever watches, and shared with processes on other cores."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from stablepush.cli.common import Progress, told

#: Processes that help, at most: no more of the code is independent.
_MOST_HELPERS = 3


def build_all() -> None:
    """Build the compiled code of plans, simulated pushes, fits and diagnoses now. It is built at first use otherwise, which then
    takes half a minute longer. The code is kept beside the package, or in the user's cache if that cannot be written."""
    started = time.perf_counter()
    for part in reversed(_PARTS):
        part()
    told(seconds=round(time.perf_counter() - started, 1))
    print(f"compiled code is ready ({time.perf_counter() - started:.1f} s)")


def build_with_helpers() -> None:
    """Say that code is being built, and start the processes that help: for the moment of the first build."""
    from numba.core import event

    event.register("numba:compile", _listener())
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    for first in range(min(cores - 1, _MOST_HELPERS)):
        with suppress(OSError):  # without help it takes longer
            helper = subprocess.Popen(
                [sys.executable, "-m", "stablepush.cli.building", str(first)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
            # what it has built by then is kept
            atexit.register(helper.kill)


def _listener() -> Any:
    from numba.core import event

    class Shown(event.Listener):  # type: ignore[misc]
        """A line of progress while code is built."""

        def __init__(self) -> None:
            self._line = Progress("first use: compiling for this machine, once")
            self._depth = self._count = 0

        def on_start(self, started: Any) -> None:
            self._depth += 1
            function = started.data["dispatcher"].py_func
            if function.__module__.startswith("stablepush"):
                self._count += 1
                self._line.describe(f"function {self._count}, {function.__name__.strip('_')}")

        def on_end(self, _: Any) -> None:
            self._depth -= 1
            if self._depth == 0:
                self._line.__exit__()

    return Shown()


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
    from_part = int(sys.argv[1])
    for work in _PARTS[from_part:] + _PARTS[:from_part]:
        work()
