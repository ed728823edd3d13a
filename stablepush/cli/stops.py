"""The signals that end a program from outside: Ctrl-C, ``kill``, a terminal that closes."""

import signal

#: All of them have the same way out.
STOPS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
