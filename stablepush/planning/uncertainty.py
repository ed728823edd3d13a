"""What is not known exactly about a push, besides the limit surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stablepush.core import InputError, Node, UnsupportedContactError, check_array, check_number
from stablepush.objects import PushContact

#: Points of one edge differ by no more (m) along its normal.
_LEVEL = 1e-9


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """How far a rig may differ from a problem. The defaults are what a careful laboratory has.

    Parameters
    ----------
    contact_friction : float or pair of floats
        Relative half-width of the friction between pusher and slider, uniform; or its lower and upper end. One draw for all
        contacts: the fingers are of one material.
    contact_place : float
        Half-width (m), uniform, of the place of the fingers along the edge. The same for all fingers of a contact: the tool is
        mounted beside where the twist of the body was planned for.
    center_of_mass : float
        Standard deviation (m) of the centre of mass along each axis of B.
    start : pair of floats
        Standard deviations of the slider's start pose under the pusher: of each coordinate in m, of the heading in rad. Plans
        then begin with a straight push that aligns the slider with two fingers.
    """

    contact_friction: float | tuple[float, float] = 0.1
    contact_place: float = 0.002
    center_of_mass: float = 0.001
    start: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        name = "uncertainty.contact_friction"
        if np.ndim(self.contact_friction):
            low, high = check_array(self.contact_friction, name, (2,)).tolist()
            if not 0 < low <= high:
                raise InputError(name, "expected an interval above 0, its lower end first", f"{low:g}, {high:g}")
            object.__setattr__(self, "contact_friction", (low, high))
        else:
            share = check_number(self.contact_friction, name, at_least=0.0)
            if share >= 1:
                raise InputError(name, "expected a relative half-width below 1: friction would reach 0", f"{share:g}")
        for field in ("contact_place", "center_of_mass"):
            check_number(getattr(self, field), f"uncertainty.{field}", at_least=0.0)
        deviations = check_array(self.start, "uncertainty.start", (2,))
        if (deviations < 0).any():
            raise InputError("uncertainty.start", "expected numbers >= 0", deviations.tolist())
        object.__setattr__(self, "start", (float(deviations[0]), float(deviations[1])))

    def friction_range(self, mu: float) -> tuple[float, float]:
        """Return the ends of the friction of a contact whose nominal friction is ``mu``."""
        if isinstance(self.contact_friction, tuple):
            return self.contact_friction
        return mu * (1 - self.contact_friction), mu * (1 + self.contact_friction)

    @property
    def relative_friction(self) -> float:
        """Half-width of the friction of the contacts over its middle."""
        given = self.contact_friction
        return (given[1] - given[0]) / (given[1] + given[0]) if isinstance(given, tuple) else given

    def worst_contact(self, contact: PushContact) -> PushContact:
        """Return a contact whose wrench cone lies in the cones of all contacts that a nominal one may be.

        Friction at the lower end of its range, and two fingers on one edge nearer to each other by the half-width of their place
        on each side. The cone of a line contact is ``mu n·f >= |t·f|`` and ``p_b x f <= tau <= p_a x f``. Less friction
        shrinks it, and moving both points by ``s`` along ``t`` adds ``s (t x f)``, of one sign for all ``n·f > 0``, to both
        bounds. So what holds here holds for every friction and place within them.

        Raises
        ------
        UnsupportedContactError
            If the places are uncertain and the contact is not two fingers on one edge that stay two.
        """
        mu, side = self.friction_range(contact.mu)[0], self.contact_place
        if side == 0:
            return PushContact(contact.points, contact.normals, mu)
        line = len(contact.points) == 2 and contact.has_one_normal
        along = np.subtract(*contact.points) if line else np.zeros(2)
        width = float(np.linalg.norm(along))
        if not line or abs(float(along @ contact.normals[0])) > _LEVEL or width <= 2 * side:
            raise UnsupportedContactError(
                "guarantee: expected two fingers on one edge, farther apart than their places are uncertain; "
                "uncertainty.contact_place=0 takes the places as exact"
            )
        inward = along * (side / width)
        return PushContact(contact.points + ((-1.0,), (1.0,)) * inward, contact.normals, mu)

    def to_json(self) -> dict[str, object]:
        """Return the ``uncertainty`` of a ``scene/1``."""
        friction = self.contact_friction
        return {
            "contact_friction": list(friction) if isinstance(friction, tuple) else friction,
            "contact_place": self.contact_place,
            "center_of_mass": self.center_of_mass,
            "start": list(self.start),
        }


_KEYS = ("contact_friction", "contact_place", "center_of_mass", "start")


def uncertainty_from_node(node: Node) -> Uncertainty:
    """Read the ``uncertainty`` of a ``scene/1``; what it leaves out has its default."""
    for key in node.object():
        if key not in _KEYS:
            node.fail(f"expected the keys {', '.join(_KEYS)}", f'"{key}"')
    given: dict[str, object] = {}
    for key in ("contact_place", "center_of_mass"):
        if key in node.value:
            given[key] = node[key].number(at_least=0.0)
    if "start" in node.value:
        given["start"] = tuple(node["start"].array(2).tolist())
    if "contact_friction" in node.value:
        friction = node["contact_friction"]
        given["contact_friction"] = (
            tuple(friction.array(2).tolist()) if isinstance(friction.value, list) else friction.number(at_least=0.0)
        )
    return node.built(lambda: Uncertainty(**given), "uncertainty")  # type: ignore[arg-type]
