"""What a user says of recorded data in a small YAML file: the rig, frames, signs and units; the rest is each importer's."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stablepush.core import FloatArray, InputError, Node, note_noise
from stablepush.io.formats import load_slider, model_or_path, slider_from_node
from stablepush.io.importers.registry import Source
from stablepush.io.json_files import read_text
from stablepush.io.pushlog import CONTACT_KINDS, Noise, PushLog, Rig
from stablepush.io.special_files import require_file
from stablepush.io.world import FORCES_ON, log_from_arrays
from stablepush.objects import Slider

#: Keys that all mappings may have.
KEYS = (
    "slider", "friction", "gravity", "contact_kind", "finger_radius", "noise",
    "body_pose", "forces_on", "zero_forces", "window", "finger_distance", "pose_delay", "force_angle", "model",
)  # fmt: skip


#: Note on a log whose rows nothing parts.
_ONE_PUSH = (
    "one push was found. A push ends where the object rests for half a second: if there were more, let it rest between them, or "
    "name them in a column (columns.trial of a table)"
)
#: Note on two fingers whose distance is not known.
_NO_DISTANCE = "finger_distance is not given: where the two fingers touch is not known, and no push of theirs can be simulated"


@dataclass(frozen=True, slots=True, eq=False)
class Mapping:
    """``root``: the file, for what only one importer reads; ``rig``; the pose (3,) of B in the tracked frame; the rest of what
    :func:`log_from_arrays` takes.
    """

    root: Node
    rig: Rig
    body_pose: FloatArray
    forces_on: str
    zero_forces: bool
    window: float | None
    finger_distance: float | None
    pose_delay: float
    force_angle: float

    def log(
        self, times: FloatArray, poses: FloatArray, forces: FloatArray | None = None, tips: FloatArray | None = None,
        trials: list[str] | None = None, moments: FloatArray | None = None,
    ) -> tuple[PushLog, list[str]]:  # fmt: skip
        """Make a log of rows in the world, as :func:`log_from_arrays` does, and notes on it."""
        try:
            log = log_from_arrays(
                self.rig, times, poses, forces, tips, trials, body_pose=self.body_pose, forces_on=self.forces_on, moments=moments,
                zero_forces=self.zero_forces, window=self.window, finger_distance=self.finger_distance,
                pose_delay=self.pose_delay, force_angle=self.force_angle,
            )  # fmt: skip
        except InputError as error:
            # what this file says is wrong in it, the rest in the records
            raise error.within(file=self.root.file) if error.place in KEYS else error from None
        notes = [_ONE_PUSH] if trials is None and len(log) == 1 else []
        if self.rig.contact_kind == "two-point" and tips is not None and self.finger_distance is None:
            notes.append(_NO_DISTANCE)
        return log, notes


def mapping_of(source: Source, slider: Slider | None, *own: str) -> Mapping:
    """Read the mapping of a source; ``own`` are the keys that its importer reads by itself."""
    if "mapping" not in source.labels:
        raise InputError("--mapping", f"expected a YAML file that says what is what, for logs of kind {source.kind}")
    file = Path(source.labels["mapping"])
    root = _read_yaml(file)
    root.expect_keys(*KEYS, *own)

    def number(key: str, otherwise: float | None, positive: bool = True) -> Any:
        node = root.get(key)
        return otherwise if node is None else node.number(positive=positive, at_least=None if positive else 0.0)

    friction, noise, kind, on = root.get("friction"), root.get("noise"), root.get("contact_kind"), root.get("forces_on")
    if friction is not None:
        friction.expect_keys("support", "contact")
    parts = {name: None if friction is None else friction.get(name) for name in ("support", "contact")}
    zero, body, model = root.get("zero_forces"), root.get("body_pose"), root.get("model")
    delay, angle = root.get("pose_delay"), root.get("force_angle")
    if zero is not None and not isinstance(zero.value, bool):
        zero.fail("expected true or false", repr(zero.value))
    pose = np.zeros(3) if body is None else body.array(3)
    lag, turn = (0.0 if node is None else node.number() for node in (delay, angle))
    rig = Rig(
        _slider(root, file, slider),
        contact_kind="point" if kind is None else kind.text(CONTACT_KINDS),
        support_friction=None if parts["support"] is None else parts["support"].zero_or_positive(),
        contact_friction=None if parts["contact"] is None else parts["contact"].number(at_least=0.0),
        gravity=number("gravity", 9.81),
        finger_radius=number("finger_radius", None, positive=False),
        noise=None if noise is None else _noise(noise),
        # what a diagnosis of the log adds to
        extra={"source": {"kind": source.kind, "body_pose": pose.tolist(), "pose_delay": lag, "force_angle": turn}},
        model=None if model is None else model_or_path(model, file.parent),
    )
    if noise is not None and rig.noise is not None:
        if rig.noise.position >= rig.slider.radius:
            noise["position"].fail(
                f"expected less than the size of the slider, {rig.slider.radius:.3g} m", f"{rig.noise.position:g} m"
            )
        note_noise(rig.noise.position, rig.noise.angle, f"{file}: noise")
    return Mapping(
        root, rig, pose, "slider" if on is None else on.text(FORCES_ON),
        True if zero is None else zero.value, number("window", None), number("finger_distance", None),
        lag, turn,
    )  # fmt: skip


def _noise(node: Node) -> Noise:
    """Noise of a row; that of the force is 0 where the log has none."""
    force = node.get("force")
    lengths = (node[key].number(at_least=0.0) for key in ("position", "angle"))
    return Noise(0.0 if force is None else force.number(at_least=0.0), *lengths)


def _slider(root: Node, file: Path, slider: Slider | None) -> Slider:
    node = root.get("slider")
    if slider is not None:
        return slider
    if node is None:
        raise InputError("slider", "expected the outline: --slider FILE, or the key slider", file=file)
    if not isinstance(node.value, str):
        return slider_from_node(node)
    require_file(file.parent / node.text())
    return load_slider(file.parent / node.text())


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """YAML without tags and aliases, whose keys stand once: ten lines of aliases make a value that fills any memory."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.events.AliasEvent):
            raise yaml.composer.ComposerError(None, None, "write the value instead of an alias (*)", self.peek_event().start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for name, _ in node.value:
            key = self.construct_object(name, deep=True)
            if not isinstance(key, str):
                raise yaml.constructor.ConstructorError(None, None, f"expected words as keys, got {key!r}", node.start_mark)
            if key in seen or seen.add(key):  # type: ignore[func-returns-value]
                raise yaml.constructor.ConstructorError(None, None, f"the key {key} stands twice", node.start_mark)
        return dict(super().construct_mapping(node, deep))


# PyYAML takes a number whose exponent has no sign, or that has no point, as 1.5e3 and 1e-6, for a word
_NUMBER = re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)[eE][-+]?[0-9]+$")
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _NUMBER, list("-+.0123456789"))


def _read_yaml(file: Path) -> Node:
    text = read_text(file)
    try:
        value = yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = "" if mark is None else f"line {mark.line + 1} column {mark.column + 1}"
        words = getattr(error, "problem", None) or getattr(error, "reason", None) or "cannot be read"
        raise InputError(place, f"expected YAML: {words}", file=file) from None
    except (RecursionError, ValueError):
        raise InputError("", "expected YAML of ordinary depth and numbers", file=file) from None
    root = Node(value, str(file))
    root.object()
    return root
