"""Where to push, and with which spacing of the fingers: contacts along the edges of a slider, ranked by their stable regions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import (
    LEAST_POSITIVE,
    FloatArray,
    InputError,
    check_array,
    check_choice,
    check_count,
    check_number,
    order_with_ties,
)
from stablepush.geometry import twist_from_cor
from stablepush.objects import PushContact, Slider
from stablepush.stability.all_pressure import all_pressure_region
from stablepush.stability.oracle import StabilityOracle
from stablepush.stability.region import StableRegion, stable_region
from stablepush.surfaces import LimitSurface

#: What contacts may be ranked by: their attribute, and the sign that sorts the best first.
MEASURES = {"area": ("area", -1.0), "tightest-turn": ("tightest_turn", 1.0), "margin": ("margin", -1.0)}
_DIRECTIONS = 181
#: Fingers that have less slack (m) than this on an edge stand on its ends. Contacts whose measures differ by no more than this
#: share are as good as each other, and stay in the order of edge, width and centre.
_FULL, _ALIKE = 1e-6, 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class RankedContact:
    """Two fingers on an edge, and what pushes they allow.

    Attributes
    ----------
    edge, center, width : int, float, float
        As in :meth:`PushContact.on_edge` (m).
    contact : PushContact
    area : float
        Solid angle (sr) of the stable region on the sphere of unit twists, translations and both senses; a hemisphere is 6.28.
    tightest_left, tightest_right : float
        Smallest distance (m) from the origin of B to a stable counter-clockwise and clockwise COR; infinite if there is none.
    margin : float or None
        Least margin (rad) over pushing straight and turning both ways with the given radius, in the direction for which that is
        best; None without a surface.
    """

    edge: int
    center: float
    width: float
    contact: PushContact
    area: float
    tightest_left: float
    tightest_right: float
    margin: float | None

    @property
    def tightest_turn(self) -> float:
        """The wider (m) of the tightest turns each way. A pusher that steers needs both."""
        return max(self.tightest_left, self.tightest_right)


def rank_contacts(  # noqa: PLR0913
    slider: Slider,
    surface: LimitSurface | None,
    mu: float,
    *,
    measure: str = "area",
    widths: ArrayLike | None = None,
    places: int = 9,
    edges: Sequence[int] | None = None,
    turn_radius: float | None = None,
    finger_radius: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> list[RankedContact]:
    """Return two-finger contacts along the edges of a slider, the best first.

    Parameters
    ----------
    slider : Slider
    surface : LimitSurface or None
        The slider's limit surface. Without one the all-pressure region stands in for the stable region: what can be promised from
        the outline alone.
    mu : float
        Coefficient of friction between finger and slider.
    measure : {"area", "tightest-turn", "margin"}
        Largest solid angle of the region, smallest turn that is stable both ways, or largest margin of straight and turning
        pushes.
    widths : array-like, optional
        Distances (m) between the fingers; a quarter, a half and three quarters of the shortest edge if not given. Those that do
        not fit on an edge are left out there.
    places : int
        Places of the middle on each edge, spread evenly over where both fingers fit.
    edges : sequence of int, optional
        Edges that can be reached; all if not given.
    turn_radius : float, optional
        Radius (m) of the turns whose margin counts; three radii of the slider if not given.
    finger_radius : float
        Radius (m) of the fingers: contacts are left out whose fingers would overlap, or have no room at an inner corner.
    progress : callable, optional
        Called with the number of contacts done and planned.
    """
    check_choice(measure, "measure", MEASURES)
    if surface is None and measure == "margin":
        raise InputError("measure", "expected area or tightest-turn; without a surface there is no margin")
    check_count(places, "places", most=1000)
    check_number(mu, "mu", positive=True)
    radius = 3 * slider.radius if turn_radius is None else check_number(turn_radius, "turn_radius", positive=True)
    lengths = [float(np.linalg.norm(np.subtract(*slider.edge(i)))) for i in range(len(slider.vertices))]
    spacings = np.array((0.25, 0.5, 0.75)) * min(lengths)
    if widths is not None:
        spacings = np.unique(check_array(np.atleast_1d(np.asarray(widths, dtype=object)).tolist(), "widths", (None,)))
        if not len(spacings) or (spacings < LEAST_POSITIVE).any():
            raise InputError("widths", "expected distances > 0 in m", ", ".join(f"{w:g}" for w in spacings))
    chosen = list(range(len(lengths)))
    if edges is not None:
        given = np.atleast_1d(np.asarray(edges, dtype=object)).tolist()
        if not given or not all(isinstance(e, (int, np.integer)) and not isinstance(e, bool) for e in given):
            raise InputError("edges", "expected numbers of edges", repr(edges))
        chosen = sorted({int(edge) for edge in given})
    settings = []
    for edge in chosen:
        slider.edge(edge)
        for width in spacings:
            free = lengths[edge] - width
            if free > _FULL:
                centers = width / 2 + free * (np.arange(places) + 0.5) / places
                settings += [(edge, float(center), float(width)) for center in centers]
            elif free > -_FULL:
                # fingers on both ends of the edge: one place
                settings.append((edge, lengths[edge] / 2, min(float(width), lengths[edge])))
    if not settings:
        raise InputError("widths", f"expected fingers that fit on an edge, the longest is {max(lengths):g} m")
    thick = check_number(finger_radius, "finger_radius", at_least=0.0)
    contacts = [(setting, PushContact.on_edge(slider, *setting, mu)) for setting in settings]
    contacts = [(setting, contact) for setting, contact in contacts if _has_room(slider, contact, thick)]
    if not contacts:
        raise InputError("finger_radius", "expected fingers that have room beside each other and the slider", f"{thick:g} m")
    found = []
    for done, ((edge, center, width), contact) in enumerate(contacts):
        region = all_pressure_region(slider, contact) if surface is None else stable_region(surface, contact)
        left, right = (_radius(region.tightest_turn(sense)) for sense in (1, -1))
        margin = None if surface is None else _steering_margin(surface, contact, region, radius)
        found.append(RankedContact(edge, center, width, contact, region.solid_angle(), left, right, margin))
        if progress is not None:
            progress(done + 1, len(contacts))
    attribute, sign = MEASURES[measure]
    values = sign * np.array([getattr(one, attribute) for one in found], dtype=np.float64)
    finite = np.abs(values[np.isfinite(values)])
    return [found[i] for i in order_with_ties(values, _ALIKE * float(finite.max(initial=0.0)))]


def _has_room(slider: Slider, contact: PushContact, radius: float) -> bool:
    """Whether fingers of a radius (m) touch at the contact points without overlapping each other or the slider."""
    if radius == 0:
        return True
    centers = contact.points - radius * contact.normals
    apart = float(np.linalg.norm(centers[0] - centers[-1])) if len(centers) > 1 else np.inf
    clear = float(shapely.distance(slider.polygon, shapely.points(centers)).min())
    return apart >= 2 * radius - _FULL and clear >= radius - _FULL


def _radius(cor: FloatArray | None) -> float:
    return float("inf") if cor is None else float(np.linalg.norm(cor))


def _steering_margin(surface: LimitSurface, contact: PushContact, region: StableRegion, radius: float) -> float:
    """Best, over directions, of the least margin of a straight push and of turns of ``radius`` to both sides."""
    if region.translations is not None:
        low, high = region.translations
        angles = np.linspace(low, high, _DIRECTIONS)
    else:
        angles = float(contact.frame[2]) + np.linspace(-np.pi / 2, np.pi / 2, _DIRECTIONS)
    ways = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    left = radius * np.stack((-ways[:, 1], ways[:, 0]), axis=-1)
    straight = np.column_stack((ways, np.zeros(len(ways))))
    oracle = StabilityOracle(surface, contact)
    margins = [oracle.margin(t) for t in (straight, twist_from_cor(left, 1.0), twist_from_cor(-left, -1.0))]
    return float(np.min(margins, axis=0).max())
