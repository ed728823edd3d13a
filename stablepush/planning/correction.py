"""What a diagnosis found of a rig, as plans need it: ``corrected`` of ``diagnosis/1``, ``alternatives`` of ``scene/1``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import FloatArray, InputError, Node, read_only
from stablepush.effects import KnownEffect, effects_from_node
from stablepush.io import model_from_node, model_to_json, read_json, slider_from_node
from stablepush.objects import Slider
from stablepush.surfaces import LimitSurface

_KEYS = (
    *("probability", "model", "contact_friction", "contact_friction_error", "finger_radius"),
    *("contact_offset", "tracker_offset", "effects"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Correction:
    """A rig as it may be.

    Attributes
    ----------
    probability : float
        That it is this one.
    surface : LimitSurface, optional
        Friction of the support, with an ensemble for what is uncertain of it; None: not known better than before.
    contact_friction, contact_friction_error : float, optional
        Friction between pusher and slider, and its standard error. None: not known better than before; with an error: less
        certain than before.
    finger_radius : float, optional
        In m.
    contact_offset : float, optional
        How far (m) the fingers are aside, along the y axis of the contact's frame.
    tracker_offset : array, shape (2,), optional
        Tracked origin less the centre of mass, in B (m).
    effects : sequence of KnownEffect
        What depends on heading, place, speed or time, and what sensors do.
    """

    probability: float = 1.0
    surface: LimitSurface | None = None
    contact_friction: float | None = None
    contact_friction_error: float | None = None
    finger_radius: float | None = None
    contact_offset: float | None = None
    tracker_offset: FloatArray | None = None
    effects: Sequence[KnownEffect] = ()

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``corrected``."""
        return {
            "probability": self.probability,
            "model": None if self.surface is None else model_to_json(self.surface),
            "contact_friction": self.contact_friction,
            "contact_friction_error": self.contact_friction_error,
            "finger_radius": self.finger_radius,
            "contact_offset": self.contact_offset,
            "tracker_offset": None if self.tracker_offset is None else self.tracker_offset.tolist(),
            "effects": [effect.to_json() for effect in self.effects],
        }


def corrections_from_node(node: Node) -> tuple[Correction, ...]:
    """Read ``corrected`` or ``alternatives``; their probabilities must not all be zero."""
    found = []
    for entry in node.items():
        entry.expect_keys(*_KEYS)
        model = entry.get("model")

        def number(key: str, entry: Node = entry) -> float | None:
            child = entry.get(key)
            return None if child is None else child.number(at_least=0.0)

        offset, tracker = entry.get("contact_offset"), entry.get("tracker_offset")
        probability = entry["probability"].number(at_least=0.0)
        if probability > 1:
            entry["probability"].fail("expected a number from 0 to 1", f"{probability:g}")
        found.append(
            Correction(
                probability,
                None if model is None else model_from_node(model),
                None if entry.get("contact_friction") is None else entry["contact_friction"].number(positive=True),
                number("contact_friction_error"),
                number("finger_radius"),
                None if offset is None else offset.number(),
                None if tracker is None else read_only(tracker.array(2)),
                effects_from_node(entry.get("effects")),
            )
        )
    if found and sum(entry.probability for entry in found) <= 0:
        node.fail("expected probabilities that are not all 0")
    return tuple(found)


#: The verdicts of a diagnosis, as its file has them.
VERDICTS = ("none", "absorbed", "named", "ambiguous", "unknown")


@dataclass(frozen=True, slots=True, eq=False)
class SavedDiagnosis:
    """What plans need of a ``diagnosis/1`` file: its verdict, the effects it names, the rigs that it found, most probable first,
    and the slider of the log and its friction on the table, which older files lack."""

    path: str | Path
    verdict: str
    named: tuple[str, ...]
    corrected: tuple[Correction, ...]
    slider: Slider | None
    support_friction: float | None = None


def load_diagnosis(path: str | Path) -> SavedDiagnosis:
    """Read a ``diagnosis/1`` file that corrects something."""
    root = read_json(path, "diagnosis/1")
    corrections = corrections_from_node(root["corrected"])
    if not corrections:
        root["corrected"].fail(
            "expected at least one entry: a log that could not be diagnosed, or was compared with another simulator's, has none"
        )
    slider, effects, verdict, friction = (root.get(key) for key in ("slider", "effects", "verdict", "support_friction"))
    return SavedDiagnosis(
        path,
        "" if verdict is None else verdict.text(VERDICTS),
        () if effects is None else tuple(node.text() for node in effects.items()),
        corrections,
        None if slider is None else slider_from_node(slider),
        None if friction is None else friction.zero_or_positive(),
    )


def load_corrections(path: str | Path) -> tuple[Correction, ...]:
    """Read the ``corrected`` of a ``diagnosis/1`` file."""
    return load_diagnosis(path).corrected


def likeliest(corrections: Sequence[Correction]) -> Correction:
    """Return the most probable correction, the first of equally probable ones."""
    if not corrections:
        words = "a log that could not be diagnosed, as one of a single push, or was compared with another simulator's, has none"
        raise InputError("report", f"expected a diagnosis with at least one correction; {words}")
    return corrections[int(np.argmax([entry.probability for entry in corrections]))]
