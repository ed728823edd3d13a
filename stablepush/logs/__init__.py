"""Logs of pushes: the project's own format and importers for labs' raw formats."""

from stablepush.logs.pushlog import Noise, PushLog, Rig, read_pushlog, write_pushlog

__all__ = ["Noise", "PushLog", "Rig", "read_pushlog", "write_pushlog"]
