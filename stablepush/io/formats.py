"""Sliders, contacts and limit surfaces as JSON (``slider/1``, ``contact``, ``model/1``)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from stablepush.core import InputError, Node, describe
from stablepush.effects import CATALOGUE
from stablepush.io.json_files import read_json
from stablepush.io.special_files import require_file
from stablepush.io.writing import write_json
from stablepush.objects import PushContact, Slider, SupportDistribution
from stablepush.surfaces import LimitSurface, surface_kinds, surface_of_kind

_T = TypeVar("_T")

#: Formats of files that are no contact.
_OTHERS = ("model", "slider", "scene", "plan", "pushlog", "diagnosis")


def slider_from_node(node: Node) -> Slider:
    """Read the value of a ``slider/1``."""
    node["format"].text(("slider/1",))
    node.expect_keys("format", "vertices", "mass", "support")
    vertices = node["vertices"].array(None, 2)
    mass = None if node["mass"].value is None else node["mass"].number(positive=True)
    support_node = node["support"]
    support = None
    if support_node.value is not None:
        support_node.expect_keys("points", "weights")
        points = support_node["points"].array(None, 2)
        weights = support_node["weights"].array(None)
        support = support_node.built(lambda: SupportDistribution(points, weights), "support")
    return node.built(lambda: Slider(vertices, mass, support), "slider")


def slider_to_json(slider: Slider) -> dict[str, Any]:
    """Return the ``slider/1`` of a slider."""
    support = slider.support
    return {
        "format": "slider/1",
        "vertices": slider.vertices.tolist(),
        "mass": slider.mass,
        "support": None if support is None else {"points": support.points.tolist(), "weights": support.weights.tolist()},
    }


def load_slider(path: str | Path) -> Slider:
    """Read a ``slider/1`` file, or the slider of a ``scene/1`` file or of a log's ``rig.json``."""
    root = read_json(path, "slider/1", "scene/1", "pushlog/1")
    return slider_from_node(root) if root["format"].value == "slider/1" else slider_or_path(root["slider"], Path(path).parent)


def save_slider(slider: Slider, path: str | Path) -> None:
    """Write a ``slider/1`` file, as ``map``, ``contacts``, ``fit`` and mappings of logs take it."""
    write_json(path, slider_to_json(slider))


def slider_or_path(node: Node, folder: Path) -> Slider:
    """Read a ``slider/1`` from a value, or from the file whose path it is, relative to ``folder``."""
    return _value_or_path(node, folder, slider_from_node, "slider/1")


def contact_or_path(node: Node, folder: Path) -> PushContact:
    """Read a ``contact`` from a value, or from the file whose path it is, relative to ``folder``."""
    return _value_or_path(node, folder, contact_from_node)


def _value_or_path(node: Node, folder: Path, read: Callable[[Node], _T], *formats: str) -> _T:
    """Read a value, or the file whose path it is; an error in that file says who named it."""
    if not isinstance(node.value, str):
        return read(node)
    if not node.value.strip():
        node.fail("expected an object, or the path of a file that has it", describe(node.value))
    path = folder / node.value
    try:
        require_file(path)
        return read(read_json(path, *formats))
    except InputError as error:
        raise InputError(f"{node.place}: {error}", "", file=node.file) from None


def contact_from_node(node: Node) -> PushContact:
    """Read the value of a ``contact``."""
    kind = node.get("format")
    if kind is not None and str(kind.value).partition("/")[0] in _OTHERS:
        kind.fail("expected a contact: points, normals and mu", kind.value)
    node.expect_keys("format", "points", "normals", "mu")
    points = node["points"].array(None, 2)
    normals = node["normals"].array(None, 2)
    mu = node["mu"].number(at_least=0.0)
    return node.built(lambda: PushContact(points, normals, mu), "contact")


def contact_to_json(contact: PushContact) -> dict[str, Any]:
    """Return the ``contact`` of a contact."""
    return {"points": contact.points.tolist(), "normals": contact.normals.tolist(), "mu": contact.mu}


def load_contact(path: str | Path, number: int | None = None) -> PushContact:
    """Read a ``contact`` file, or a contact of a ``scene/1`` file: the only one, or that of the ``number``, counted from 0 as in
    plans."""
    root = read_json(path)
    kind = root.get("format")
    if number is not None and (isinstance(number, bool) or not isinstance(number, int)):
        raise InputError("number", "expected the number of a contact of a scene", repr(number))
    if kind is None or kind.value != "scene/1":
        if number is not None:
            raise InputError("", f"expected a scene, for a contact of the number {number}", file=path)
        return contact_from_node(root)
    contacts = list(root["contacts"].items())
    if number is None and len(contacts) == 1:
        number = 0
    if number is None or not 0 <= number < len(contacts):
        got = f"got {len(contacts)}" if number is None else f"got number {number} of {len(contacts)}"
        last = len(contacts) - 1
        choice = f"choose one by its number, 0 to {last} (--contact)" if last else "its only contact has the number 0 (--contact)"
        root["contacts"].fail(f"expected one contact, {got}: {choice}")
    return contact_or_path(contacts[number], Path(path).parent)


def save_contact(contact: PushContact, path: str | Path) -> None:
    """Write a contact to a ``contact`` file, as ``classify``, ``map`` and others take it."""
    write_json(path, contact_to_json(contact))


def model_from_node(node: Node) -> LimitSurface:
    """Read the value of a ``model/1``; ``effects``, which ``diagnose --mended`` writes beside it, are not read."""
    node["format"].text(("model/1",))
    kind = node["kind"].text(tuple(surface_kinds()))
    return surface_of_kind(kind).from_json(node.without("effects"))


def model_or_path(node: Node, folder: Path) -> LimitSurface:
    """Read a ``model/1`` from a value, or from the file whose path it is, relative to ``folder``."""
    if not isinstance(node.value, dict | str):
        node.fail("expected a model/1 object or the path of one")
    return _value_or_path(node, folder, model_from_node, "model/1")


def model_to_json(surface: LimitSurface) -> dict[str, Any]:
    """Return the ``model/1`` of a limit surface."""
    if not isinstance(surface, LimitSurface):
        raise InputError("surface", "expected a limit surface", type(surface).__name__)
    return {"format": "model/1", "kind": surface.kind, **surface.to_json()}


def load_model(path: str | Path) -> LimitSurface:
    """Read a limit surface from a ``model/1`` file, or that of a ``scene/1`` file, which must have no effects that stability
    depends on."""
    root = read_json(path, "model/1", "scene/1")
    if root["format"].value == "model/1":
        return model_from_node(root)
    effects = root.get("effects")
    for entry in [] if effects is None else effects.items():
        id = entry["effect"].text(tuple(CATALOGUE))
        if effects is not None and CATALOGUE[id].changes_plans:
            words = "stability then depends on heading and place (stablepush.views.plot.plot_headings)"
            effects.fail(f"expected none like {id}: {words}")
    return model_or_path(root["model"], Path(path).parent)


def save_model(surface: LimitSurface, path: str | Path) -> None:
    """Write a limit surface to a ``model/1`` file."""
    write_json(path, model_to_json(surface))
