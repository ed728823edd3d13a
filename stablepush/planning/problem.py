"""A planning problem: what is pushed, how, among what, from where to where (``scene/1``)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import (
    FloatArray,
    InputError,
    check_array,
    check_number,
    note_distance,
    note_finger,
    note_friction,
    note_heading,
    note_margin,
    note_off_outline,
    note_overlap,
    note_part,
    note_push_speed,
    note_scene,
    note_tolerance,
    read_only,
)
from stablepush.effects import CATALOGUE, Effect, KnownEffect, effects_from_node
from stablepush.geometry import contacts_on_outline, inverse, transform_points, unit
from stablepush.io import (
    contact_or_path,
    contact_to_json,
    model_or_path,
    model_to_json,
    read_json,
    slider_or_path,
    slider_to_json,
    write_json,
)
from stablepush.objects import PushContact, Slider, check_simple_polygon
from stablepush.planning.correction import Correction, corrections_from_node
from stablepush.planning.uncertainty import Uncertainty, uncertainty_from_node
from stablepush.surfaces import LimitSurface, check_surface

#: Corners of a polygon round a disc, as angles (rad) from the middle of a side, and how near its sides come, in radii of it.
_CORNERS = (np.arange(16) + 0.5) * (2 * np.pi / 16)
_ROUND = float(np.cos(np.pi / 16))
#: Sides of a quarter of a circle round the corner of an obstacle.
_QUARTER = 8
#: A clearance (m) that is none.
_NEGLIGIBLE = 1e-6
#: A pusher that is docked may reach so far (m) into the slider: coordinates are rounded.
_DEEP = 1e-4


#: How much farther (over the slider's radius) than the nearest edge another one counts as near, and rounding of a cosine.
_BESIDE = 1e-3
#: Distance of a contact point from the outline, over the radius, up to which it is meant to be on it.
_NEARBY = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class PlanningProblem:
    """Push a slider from a start pose into a goal region without losing it or hitting anything.

    Parameters
    ----------
    slider : Slider
    surface : LimitSurface
        Limit surface that decides which pushes are stable.
    contacts : sequence of PushContact
        Contacts that the pusher may use; it starts docked at the first.
    start, goal : array-like, shape (3,)
        Poses ``(x, y, theta)`` of B in W (m, rad).
    obstacles : sequence of array-like, shape (n, 2)
        Simple polygons in W (m), of either orientation. Touching them is no collision.
    bounds : array-like, shape (4,), optional
        ``(xmin, ymin, xmax, ymax)`` in W (m), which hold the whole outline of slider and pusher; unbounded if None.
    pusher : array-like, shape (n, 2), optional
        Outline of the pusher (m) in its own frame: origin midway between the contact points, x axis along their mean normal.
    tolerance : pair of floats
        Largest distance (m) and heading difference (rad) from the goal.
    speed : float
        Speed limit (m/s) of the fastest point of the slider's outline.
    switch_cost : float
        Time (s) that a change of contact takes.
    min_margin : float
        Least margin (rad) that every push must have.
    uncertainty : Uncertainty, optional
        How far the rig may differ from all this.
    finger_radius : float
        Radius (m) of the fingers: discs behind the contact points. A pusher outline, if given, takes their place.
    effects : sequence of Effect or KnownEffect
        What the rig is known to do. Planners and the check take into account what acts on support and weight (:data:`PLANNED`);
        effects of sensors and drift change no plan.
    alternatives : sequence of Correction
        Rigs that this may be, with their probabilities: scenarios are drawn from all of them.
    support_friction : float, optional
        Coefficient of friction of the support, where the surface's forces are in units of ``mu*N`` and newtons count.
    """

    slider: Slider
    surface: LimitSurface
    contacts: tuple[PushContact, ...]
    start: FloatArray
    goal: FloatArray
    obstacles: tuple[FloatArray, ...]
    bounds: FloatArray | None
    pusher: FloatArray | None
    tolerance: tuple[float, float]
    speed: float
    switch_cost: float
    min_margin: float
    uncertainty: Uncertainty
    finger_radius: float
    effects: tuple[KnownEffect, ...]
    alternatives: tuple[Correction, ...]
    support_friction: float | None

    def __init__(  # noqa: PLR0913
        self,
        slider: Slider,
        surface: LimitSurface,
        contacts: Sequence[PushContact],
        start: ArrayLike,
        goal: ArrayLike,
        obstacles: Sequence[ArrayLike] = (),
        bounds: ArrayLike | None = None,
        pusher: ArrayLike | None = None,
        tolerance: tuple[float, float] = (0.01, 0.05),
        speed: float = 0.05,
        switch_cost: float = 0.0,
        min_margin: float = 0.0,
        uncertainty: Uncertainty | None = None,
        *,
        finger_radius: float = 0.0,
        effects: Sequence[Effect | KnownEffect] = (),
        alternatives: Sequence[Correction] = (),
        support_friction: float | None = None,
    ) -> None:
        if not isinstance(slider, Slider):
            raise InputError("slider", "expected a Slider, as Slider.centered(vertices)", type(slider).__name__)
        if isinstance(contacts, PushContact):
            raise InputError("contacts", "expected a list of PushContact", "one PushContact")
        contacts = tuple(contacts)
        for number, contact in enumerate(contacts):
            if not isinstance(contact, PushContact):
                raise InputError(f"contacts[{number}]", "expected a PushContact", type(contact).__name__)
        if len(contacts) == 0:
            raise InputError("contacts", "expected at least one contact")
        box = None
        if bounds is not None:
            box = check_array(bounds, "bounds", (4,))
            if not (box[:2] < box[2:]).all():
                raise InputError("bounds", "expected xmin < xmax and ymin < ymax")
            box = read_only(box)
        limits = check_array(tolerance, "tolerance", (2,))
        if (limits < 0).any():
            raise InputError("tolerance", "expected numbers >= 0")
        polygons = tuple(read_only(check_simple_polygon(outline, f"obstacles[{i}]")) for i, outline in enumerate(obstacles))
        outline = None if pusher is None else read_only(check_simple_polygon(pusher, "pusher.outline"))
        object.__setattr__(self, "slider", slider)
        object.__setattr__(self, "surface", check_surface(surface, "surface"))
        object.__setattr__(self, "contacts", contacts)
        object.__setattr__(self, "start", read_only(check_array(start, "start", (3,))))
        object.__setattr__(self, "goal", read_only(check_array(goal, "goal", (3,))))
        object.__setattr__(self, "obstacles", polygons)
        object.__setattr__(self, "bounds", box)
        object.__setattr__(self, "pusher", outline)
        object.__setattr__(self, "tolerance", (float(limits[0]), float(limits[1])))
        object.__setattr__(self, "speed", check_number(speed, "speed", positive=True))
        object.__setattr__(self, "switch_cost", check_number(switch_cost, "switch_cost", at_least=0.0))
        object.__setattr__(self, "min_margin", check_number(min_margin, "min_margin"))
        object.__setattr__(self, "uncertainty", Uncertainty() if uncertainty is None else uncertainty)
        object.__setattr__(self, "finger_radius", check_number(finger_radius, "finger_radius", at_least=0.0))
        known = [KnownEffect(effect) if isinstance(effect, Effect) else effect for effect in effects]
        if len({entry.effect.id for entry in known}) < len(known):
            raise InputError("effects", "expected every effect once")
        object.__setattr__(self, "effects", tuple(known))
        object.__setattr__(self, "alternatives", tuple(alternatives))
        mu = None if support_friction is None else check_number(support_friction, "support_friction", positive=True)
        object.__setattr__(self, "support_friction", mu)
        # another unit is noted also where it ends in an error
        self._doubt()
        self._require_inward_normals()
        self._require_pusher_outside()
        self._require_fingers_outside()

    def _require_inward_normals(self) -> None:
        """Refuse a contact on the outline whose fingers would pull."""
        starts = self.slider.vertices
        along = np.roll(starts, -1, axis=0) - starts
        inward = unit(np.stack((-along[:, 1], along[:, 0]), axis=-1))
        edges = shapely.linestrings(np.stack((starts, starts + along), axis=1))
        for i, contact in enumerate(self.contacts):
            for k, (point, normal) in enumerate(zip(contact.points, contact.normals, strict=True)):
                away = shapely.distance(edges, shapely.points(point))
                near = inward[away <= away.min() + _BESIDE * self.slider.radius]
                # of a point far off the outline nobody knows which edge it is meant for
                if away.min() < _NEARBY * self.slider.radius and (near @ normal).max() < -_BESIDE:
                    raise InputError(f"contacts[{i}].normals[{k}]", "expected a normal that points into the slider")

    def _require_pusher_outside(self) -> None:
        """Refuse a pusher whose outline, docked at a contact, fills a part of the slider."""
        edge = self.slider.polygon.exterior
        for i, contact in enumerate(self.contacts if self.pusher is not None else ()):
            # contact points that are off the outline are noted, and move the pusher as far
            off = float(shapely.distance(edge, shapely.points(contact.points)).max())
            for docked in self.docked_outlines(contact):
                shared = shapely.intersection(shapely.Polygon(docked), self.slider.polygon)
                if not shapely.buffer(shared, -(_DEEP + off) / 2).is_empty:
                    words = f"expected a pusher that only touches; docked at contact {i} it overlaps the slider"
                    raise InputError("pusher.outline", words, f"{1e4 * shared.area:.3g} cm²")

    def _require_fingers_outside(self) -> None:
        """Refuse a contact at which a finger stands inside the slider, as beside an inner corner, whatever normal is stated."""
        for i, contact in enumerate(self.contacts if self.pusher is None and self.finger_radius > 0 else ()):
            near, inward, away = contacts_on_outline(self.slider.vertices, contact.points)
            stated, touching = contact.points - self.finger_radius * contact.normals, near - self.finger_radius * inward
            room = [shapely.distance(self.slider.polygon, shapely.points(centers)) for centers in (stated, touching)]
            depth = float((self.finger_radius - np.maximum(*room) - np.abs(away)).max())
            if depth > _DEEP:
                words = f"expected fingers that only touch; docked at contact {i} one stands inside the slider"
                raise InputError("finger_radius", words, f"{1000 * depth:.2g} mm")

    def _doubt(self) -> None:
        """Note what looks like another unit."""
        for name in ("start", "goal"):
            pose = getattr(self, name)
            note_scene(pose[:2], name)
            note_heading(float(pose[2]), f"{name}[2]")
        if self.bounds is not None:
            note_scene(self.bounds, "bounds")
        if self.obstacles:
            note_scene(np.concatenate(self.obstacles), "obstacles")
        note_distance(float(np.hypot(*(self.goal - self.start)[:2])), self.slider.radius, "goal, from the start")
        note_tolerance(*self.tolerance, self.slider.radius, "tolerance")
        note_push_speed(self.speed, "speed")
        note_margin(self.min_margin, "min_margin")
        note_finger(self.finger_radius, "finger_radius")
        note_friction(self.support_friction or 0.0, "support_friction")
        for i, contact in enumerate(self.contacts):
            note_part(contact.points, self.slider.radius, f"contacts[{i}].points")
            edge = self.slider.polygon.exterior
            note_off_outline(float(shapely.distance(edge, shapely.points(contact.points)).max()), f"contacts[{i}].points")
            if self.finger_radius > 0:
                centers = shapely.points(contact.points - self.finger_radius * contact.normals)
                depths = self.finger_radius - shapely.distance(self.slider.polygon, centers)
                note_overlap(float(depths.max()), self.finger_radius, f"contacts[{i}]")
        if self.pusher is not None:
            note_part(self.pusher, self.slider.radius, "pusher.outline")
        note_part([(self.surface.characteristic_length, 0.0)], self.slider.radius, "model.characteristic_length")

    def starting_at(self, start: ArrayLike) -> PlanningProblem:
        """Return the same problem with another start pose (3,)."""
        return self.with_changes(start=start)

    def with_changes(self, **changes: Any) -> PlanningProblem:
        """Return the same problem with other values of some attributes."""
        return PlanningProblem(**{field.name: getattr(self, field.name) for field in fields(self)} | changes)

    @property
    def acting_effects(self) -> list[str]:
        """Ids of the effects, of the problem and its alternatives, that change which pushes are stable."""
        every = [*self.effects, *(effect for entry in self.alternatives for effect in entry.effects)]
        return list(dict.fromkeys(entry.effect.id for entry in every if not entry.changes_no_plan))

    def require_plannable(self) -> None:
        """Refuse what neither planners nor the check take into account."""
        for id in self.acting_effects:
            if id not in PLANNED:
                raise InputError("effects", f"expected effects that plans know: {CATALOGUE[id].instead}", id)
        if self.acting_effects and any(self.uncertainty.start):
            words = "expected 0, 0, or no effect of the table: an uncertain start is not planned for beside such an effect"
            raise InputError("uncertainty.start", words, ", ".join(self.acting_effects))
        if self.acting_effects and not self.surface.is_dual:
            raise InputError("effects", f"expected none, a {type(self.surface).__name__} is not planned with them")
        for number, entry in enumerate(self.alternatives):
            for name in ("finger_radius", "contact_offset", "tracker_offset"):
                if getattr(entry, name) is not None:
                    place = f"alternatives[{number}].{name}"
                    raise InputError(place, "expected null: plans do not draw it, uncertainty.start and contact_place hold it")

    def pusher_outlines(self, contact: PushContact) -> list[FloatArray]:
        """Return polygons (n, 2) that the pusher fills, in its own frame (m), docked at a contact; none if it is points.

        The pusher's outline, or discs of ``finger_radius`` behind the contact points, as polygons round them that touch the edge
        with a side.
        """
        if self.pusher is not None:
            return [self.pusher]
        return disc_outlines(contact, self.finger_radius) if self.finger_radius > 0 else []

    def with_clearance(self, distance: float | FloatArray) -> PlanningProblem:
        """Return the problem with obstacles that are larger by a distance (m) all round, or by one each (n,); below 1e-6 m, as
        they are.

        Raises :class:`InputError` for a distance that is negative or not finite.
        """
        growth = [distance] * len(self.obstacles) if np.ndim(distance) == 0 else list(np.asarray(distance))
        checked = [check_number(each, "clearance", at_least=0.0) for each in (growth or [distance])]
        if max(checked) < _NEGLIGIBLE:
            return self
        # corners of a polygon round a disc lie on it, its sides within; a side may be half as long again as it should be
        around = 1 / math.cos(1.5 * math.pi / (4 * _QUARTER))
        rings = []
        for corners, by in zip(self.obstacles, growth, strict=True):
            if by < _NEGLIGIBLE:
                rings.append(corners)
                continue
            grown = shapely.Polygon(corners).buffer(by * around, quad_segs=_QUARTER)
            rings += [np.asarray(part.exterior.coords, dtype=np.float64)[:-1] for part in _simple(grown)]
        return replace(self, obstacles=tuple(rings))

    def docked_outlines(self, contact: PushContact) -> list[FloatArray]:
        """Return the outlines of the docked pusher, in B (m)."""
        return [transform_points(contact.frame, outline) for outline in self.pusher_outlines(contact)]

    def push_speed(self, twists: ArrayLike) -> FloatArray:
        """Return the speed (...) in m/s of the fastest point of the slider's outline at body twists (..., 3)."""
        v = np.asarray(twists, dtype=np.float64)[..., None, :]
        p = self.slider.vertices
        return np.asarray(np.hypot(v[..., 0] - v[..., 2] * p[:, 1], v[..., 1] + v[..., 2] * p[:, 0]).max(axis=-1))


def disc_outlines(contact: PushContact, radius: float) -> list[FloatArray]:
    """Return polygons (n, 2) round discs behind the points of a contact, in its frame (m)."""
    at = inverse(contact.frame)
    centers = transform_points(at, contact.points - radius * contact.normals)
    toward = np.arctan2(contact.normals[:, 1], contact.normals[:, 0]) + at[2]
    return [
        center + radius / _ROUND * np.stack((np.cos(angle + _CORNERS), np.sin(angle + _CORNERS)), axis=-1)
        for center, angle in zip(centers, toward, strict=True)
    ]


#: Effects that change which pushes are stable, and that plans take into account.
PLANNED = tuple(id for id, kind in CATALOGUE.items() if kind.planned)

#: Keys that a scene must have, and those that it may have.
_REQUIRED = (
    *("format", "slider", "model", "contacts", "pusher", "obstacles", "bounds", "start", "goal"),
    *("tolerance", "speed", "switch_cost", "min_margin"),
)
_OPTIONAL = ("uncertainty", "finger_radius", "support_friction", "effects", "alternatives")


def require_problem(problem: object) -> None:
    """Refuse what is no :class:`PlanningProblem`, as the path of a scene."""
    if not isinstance(problem, PlanningProblem):
        words = "expected a PlanningProblem; stablepush.load_scene reads one from a file"
        raise InputError("problem", words, repr(problem) if isinstance(problem, str) else type(problem).__name__)


def load_scene(path: str | Path) -> PlanningProblem:
    """Read a ``scene/1`` file. A slider, a model or a contact may be a path, from the scene's folder, of a file that has it."""
    root = read_json(path, "scene/1")
    root.expect_keys(*_REQUIRED, *_OPTIONAL)
    root.require(*_REQUIRED)
    folder = Path(path).parent
    slider = slider_or_path(root["slider"], folder)
    surface = model_or_path(root["model"], folder)
    contacts = [contact_or_path(node, folder) for node in root["contacts"].items()]
    if not contacts:
        root["contacts"].fail("expected at least one contact")
    pusher_node = root["pusher"] if root["pusher"].value is not None else None
    pusher = None
    if pusher_node is not None:
        pusher_node.expect_keys("outline")
        outline_node = pusher_node["outline"]
        pusher = outline_node.array(None, 2)
        outline_node.checked(lambda: check_simple_polygon(pusher, ""))
    obstacles = []
    for node in root["obstacles"].items():
        outline = node.array(None, 2)
        obstacles.append(node.checked(lambda outline=outline: check_simple_polygon(outline, "")))  # type: ignore[misc]
    tolerance = root["tolerance"].array(2)
    if (tolerance < 0).any():
        root["tolerance"].fail("expected numbers >= 0", tolerance.tolist())
    bounds = root["bounds"].array(4)
    if not (bounds[:2] < bounds[2:]).all():
        root["bounds"].fail("expected xmin < xmax and ymin < ymax", bounds.tolist())
    start, goal = root["start"].array(3), root["goal"].array(3)
    speed = root["speed"].number(positive=True)
    switch_cost = root["switch_cost"].number(at_least=0.0)
    min_margin = root["min_margin"].number()
    support = root.get("support_friction")
    support_friction = None if support is None else support.number(positive=True)
    effects, others = effects_from_node(root.get("effects")), root.get("alternatives")
    alternatives = () if others is None else corrections_from_node(others)
    radius = root.get("finger_radius")
    finger_radius = 0.0 if radius is None else radius.number(at_least=0.0)
    unknown = root.get("uncertainty")
    uncertainty = None if unknown is None else uncertainty_from_node(unknown)
    return root.built(
        lambda: PlanningProblem(
            slider,
            surface,
            contacts,
            start,
            goal,
            obstacles,
            bounds,
            pusher,
            (float(tolerance[0]), float(tolerance[1])),
            speed,
            switch_cost,
            min_margin,
            uncertainty,
            finger_radius=finger_radius,
            effects=effects,
            alternatives=alternatives,
            support_friction=support_friction,
        )
    )


def save_scene(problem: PlanningProblem, path: str | Path) -> None:
    """Write a ``scene/1`` file with its model inside. A problem without bounds has no ``scene/1``."""
    if problem.bounds is None:
        raise InputError("bounds", "expected bounds, a scene/1 file must have them")
    write_json(path, scene_to_json(problem))


def scene_to_json(problem: PlanningProblem) -> dict[str, Any]:
    """Return the ``scene/1`` of a problem, with its model inside; ``bounds`` is None if it has none."""
    return {
        "format": "scene/1",
        "slider": slider_to_json(problem.slider),
        "model": model_to_json(problem.surface),
        "contacts": [contact_to_json(c) for c in problem.contacts],
        "pusher": None if problem.pusher is None else {"outline": problem.pusher.tolist()},
        "obstacles": [o.tolist() for o in problem.obstacles],
        "bounds": None if problem.bounds is None else problem.bounds.tolist(),
        "start": problem.start.tolist(),
        "goal": problem.goal.tolist(),
        "tolerance": list(problem.tolerance),
        "speed": problem.speed,
        "switch_cost": problem.switch_cost,
        "min_margin": problem.min_margin,
        "uncertainty": problem.uncertainty.to_json(),
        "finger_radius": problem.finger_radius,
        **({} if problem.support_friction is None else {"support_friction": problem.support_friction}),
        **({"effects": [effect.to_json() for effect in problem.effects]} if problem.effects else {}),
        **({"alternatives": [entry.to_json() for entry in problem.alternatives]} if problem.alternatives else {}),
    }


def _simple(shape: shapely.Polygon) -> list[shapely.Polygon]:
    """A polygon as polygons without holes: what encloses a free place is cut through it."""
    if not len(shape.interiors):
        return [shape]
    low, bottom, high, top = shape.bounds
    cut = float(shape.interiors[0].centroid.x)
    halves = (shape.intersection(shapely.box(*box)) for box in ((low, bottom, cut, top), (cut, bottom, high, top)))
    return [one for half in halves for part in shapely.get_parts(half) if part.area > 0 for one in _simple(part)]
