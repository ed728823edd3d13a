"""Sliders, contacts and limit surfaces as JSON (``slider/1``, ``contact``, ``model/1``)."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from stablepush.core import LEAST_POSITIVE, InputError
from stablepush.io.json_files import Node, describe, read_json, write_json
from stablepush.objects import PushContact, Slider, SupportDistribution
from stablepush.surfaces import (
    FORCE_UNITS,
    GaussianProcessSurface,
    IdealLimitSurface,
    KernelSum,
    LimitSurface,
    PolynomialLimitSurface,
    monomial_exponents,
)


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
        support = support_node.checked(lambda: SupportDistribution(points, weights))
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
    """Read a ``slider/1`` file."""
    return slider_from_node(read_json(path, "slider/1"))


def contact_from_node(node: Node) -> PushContact:
    """Read the value of a ``contact``."""
    node.expect_keys("format", "points", "normals", "mu")
    points = node["points"].array(None, 2)
    normals = node["normals"].array(None, 2)
    mu = node["mu"].number(at_least=0.0)
    return node.built(lambda: PushContact(points, normals, mu), "contact")


def contact_to_json(contact: PushContact) -> dict[str, Any]:
    """Return the ``contact`` of a contact."""
    return {"points": contact.points.tolist(), "normals": contact.normals.tolist(), "mu": contact.mu}


def load_contact(path: str | Path) -> PushContact:
    """Read a ``contact`` file."""
    return contact_from_node(read_json(path))


#: Keys of a polynomial, besides those of every model and the unit, which may be left out.
_OF_POLYNOMIAL = (
    *("degree", "characteristic_length", "exponents", "coefficients"),
    *("certificate", "covariance", "ensemble", "provenance"),
)


def model_from_node(node: Node) -> LimitSurface:
    """Read the value of a ``model/1``."""
    node["format"].text(("model/1",))
    kind = node["kind"].text(("polynomial", "support", "gp"))
    if kind == "support":
        node.expect_keys("format", "kind", "points", "loads", "characteristic_length")
        points = node["points"].array(None, 2)
        loads = node["loads"].array(None)
        if (loads < 0).any():
            node["loads"].fail("expected loads >= 0", f"{loads.min():g}")
        if loads.sum() < LEAST_POSITIVE:
            node["loads"].fail(f"expected a sum of at least {LEAST_POSITIVE:g}", f"{loads.sum():g}")
        rho_node = node.get("characteristic_length")
        given = None if rho_node is None else rho_node.number(positive=True)
        return node.checked(lambda: IdealLimitSurface(SupportDistribution(points, loads), float(loads.sum()), given))
    if kind == "gp":
        return _gaussian_process(node)
    node.expect_keys("format", "kind", "force_unit", *_OF_POLYNOMIAL)
    degree = node["degree"].integer(at_least=2)
    if degree not in (2, 4, 6, 8, 10):
        node["degree"].fail("expected an even number from 2 to 10", describe(degree))
    rho = node["characteristic_length"].number(positive=True)
    coefficients = _coefficients(node, degree)
    certificate, covariance_node, provenance = node["certificate"], node["covariance"], node["provenance"]
    size = len(coefficients)
    covariance = None if covariance_node.value is None else covariance_node.array(size, size)
    ensemble_node = node.get("ensemble")
    ensemble = None if ensemble_node is None else ensemble_node.array(None, size)
    unit_node = node.get("force_unit")
    force_unit = "N" if unit_node is None else unit_node.text(FORCE_UNITS)
    return node.checked(
        lambda: PolynomialLimitSurface(
            coefficients,
            degree,
            rho,
            force_unit=force_unit,
            certificate=None if certificate.value is None else certificate.object(),
            covariance=covariance,
            ensemble=ensemble,
            provenance=None if provenance.value is None else provenance.object(),
        )
    )


#: Kernel sums of a Gaussian process in its file, and how many coefficients each has for an input.
_KERNEL_SUMS = {"slip": 3, "log_size": 1, "load": 3}


def _gaussian_process(node: Node) -> GaussianProcessSurface:
    node.expect_keys("format", "kind", "characteristic_length", "mean_size", "provenance", *_KERNEL_SUMS)
    sums: dict[str, KernelSum] = {}
    for name, width in _KERNEL_SUMS.items():
        entry = node[name]
        entry.expect_keys("inputs", "coefficients", "length")
        inputs, coefficients = entry["inputs"].array(None, 3), entry["coefficients"].array(None, width)
        length = entry["length"].number(positive=True)
        sums[name] = entry.checked(partial(KernelSum, inputs, coefficients, length))
    size, rho = node["mean_size"].number(positive=True), node["characteristic_length"].number(positive=True)
    provenance = node["provenance"]
    said = None if provenance.value is None else provenance.object()
    return node.checked(lambda: GaussianProcessSurface(sums["slip"], sums["log_size"], sums["load"], size, rho, provenance=said))


def _coefficients(node: Node, degree: int) -> np.ndarray:
    """Coefficients in the library's order, whatever order the file has; monomials that it leaves out are zero."""
    exponents = node["exponents"].array(None, 3)
    given = node["coefficients"].array(None)
    if len(exponents) != len(given):
        node["coefficients"].fail(f"expected {len(exponents)} numbers, one for each exponent", len(given))
    place = {tuple(row): i for i, row in enumerate(monomial_exponents(degree).tolist())}
    coefficients = np.zeros(len(place))
    seen: set[int] = set()
    for entry, row, value in zip(node["exponents"].items(), exponents.tolist(), given, strict=True):
        index = place.get(tuple(row))
        if index is None:
            entry.fail(f"expected three whole numbers >= 0 with the sum {degree}", entry.value)
        if index in seen:
            entry.fail(f"expected every monomial once, {entry.value} stands twice")
        seen.add(index)
        coefficients[index] = value
    return coefficients


def model_to_json(surface: LimitSurface) -> dict[str, Any]:
    """Return the ``model/1`` of a limit surface."""
    if isinstance(surface, IdealLimitSurface):
        return {
            "format": "model/1",
            "kind": "support",
            "points": surface.support.points.tolist(),
            "loads": surface.loads.tolist(),
            "characteristic_length": surface.characteristic_length,
        }
    if isinstance(surface, GaussianProcessSurface):
        sums = {name: getattr(surface, name) for name in _KERNEL_SUMS}
        return {
            "format": "model/1",
            "kind": "gp",
            "characteristic_length": surface.characteristic_length,
            "mean_size": surface.mean_size,
            **{
                name: {"inputs": k.inputs.tolist(), "coefficients": k.coefficients.tolist(), "length": k.length}
                for name, k in sums.items()
            },
            "provenance": dict(surface.provenance),
        }
    if not isinstance(surface, PolynomialLimitSurface):
        raise InputError("surface", "expected a limit surface of this library", f"{type(surface).__name__}")
    return {
        "format": "model/1",
        "kind": "polynomial",
        "degree": surface.degree,
        "characteristic_length": surface.characteristic_length,
        "force_unit": surface.force_unit,
        "exponents": surface.exponents.tolist(),
        "coefficients": surface.coefficients.tolist(),
        "certificate": None if surface.certificate is None else dict(surface.certificate),
        "covariance": None if surface.covariance is None else surface.covariance.tolist(),
        "ensemble": None if surface.ensemble is None else surface.ensemble.tolist(),
        "provenance": dict(surface.provenance),
    }


def load_model(path: str | Path) -> LimitSurface:
    """Read a limit surface from a ``model/1`` file."""
    return model_from_node(read_json(path, "model/1"))


def save_model(surface: LimitSurface, path: str | Path) -> None:
    """Write a limit surface to a ``model/1`` file."""
    write_json(path, model_to_json(surface))
