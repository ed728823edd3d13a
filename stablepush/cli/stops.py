"""What terminals and systems send and take: the signals that end a program from outside, and what clears a line."""

import signal

#: All of them have the same way out.
STOPS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
#: Clears a line of progress on a terminal.
CLEAR = "\r\x1b[K"
