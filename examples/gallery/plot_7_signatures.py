"""
How does each effect show?
==========================

The same sixty pushes of a simulated rig: as its operator believes it to be (grey), and with one effect
(orange). Each picture draws what gives that effect away. A dot is a push, in the last picture a row of one
push. Forces and moments are compared with the nominal simulation.
"""

import matplotlib.pyplot as plt
import numpy as np
import shapely

import stablepush as sp
from stablepush.geometry import rotate_vectors

RADIUS, MU, MASS = 0.005, 0.6, 1.2
feet = sp.SupportDistribution([(-0.03, -0.03), (0.07, -0.03), (-0.03, 0.06), (0.01, 0.0)], [1, 1, 1, 1])
slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)], mass=MASS, support=feet)
surface = sp.IdealLimitSurface(feet, 0.35 * MASS * 9.81)
rho = surface.characteristic_length
noise = sp.Noise(force=0.02, position=5e-5, angle=5e-4)
pushes = sp.random_pushes(slider, sp.Pusher.finger(RADIUS), 60, seed=2)
directions = np.degrees([push.direction for push in pushes])
fastest = 1 + int(np.argmax([push.speed for push in pushes]))


class Seen:
    """What the log of the pushes shows of each of them."""

    def __init__(self, *effects):
        rig = sp.VirtualRig(
            slider,
            surface,
            MU,
            sp.Pusher.finger(RADIUS),
            [sp.parse_effect(words) for words in effects],
            noise,
        )
        log = rig.execute(pushes, seed=3).log
        self.loads, self.twists, names = log.pairs()
        self.number = np.array([int(name) for name in names])
        rows = {name: (log.samples["trial"] == name) & (log.samples["phase"] == "push") for name in names}
        self.poses = np.array([log.columns("x", "y", "theta")[rows[name]].mean(axis=0) for name in names])
        self.nominal = surface.wrench(self.twists)
        size = np.linalg.norm(self.nominal / (1, 1, rho), axis=1) ** 2
        self.ratio = (self.loads * self.nominal / (1, 1, rho**2)).sum(axis=1) / size
        self.left = self.loads - self.nominal
        self.left_in_w = rotate_vectors(self.poses[:, 2], self.left[:, :2])
        forward = np.arctan2(self.twists[:, 1], self.twists[:, 0])
        self.heading = np.degrees(np.angle(np.exp(1j * (forward + self.poses[:, 2]))))
        self.heading_in_b = np.degrees(forward)
        self.speed = 1000 * np.linalg.norm(self.twists[:, :2], axis=1)
        t, fx, fy = log.columns("t", "fx", "fy")[rows[str(fastest)]].T
        self.fastest = t, np.hypot(fx, fy)
        self.rest, self.depth, self.slant = [], [], []
        for name in names:
            mine = log.samples["trial"] == name
            still = mine & (log.samples["phase"] == "rest")
            turn = log.columns("theta")[still].mean() if still.any() else 0.0
            self.rest.append(rotate_vectors(turn, np.nan_to_num(log.columns("fx", "fy")[still]).mean(axis=0)))
            x, y, theta, px, py = log.columns("x", "y", "theta", "px", "py")[rows[name]].T
            tips = shapely.points(rotate_vectors(-theta, np.column_stack((px - x, py - y))))
            gaps = np.where(shapely.contains(slider.polygon, tips), -1, 1) * shapely.distance(
                slider.polygon.exterior, tips
            )
            self.depth.append(1000 * np.median(gaps - RADIUS))
            normal = pushes[int(name) - 1].normal
            force = self.loads[len(self.slant)]
            self.slant.append((normal[0] * force[1] - normal[1] * force[0]) / (normal @ force[:2]))
        self.rest = np.array(self.rest)


def turned(seen):
    """Angle (deg) from the nominal to the measured force."""
    (a, b), (c, d) = seen.nominal[:, :2].T, seen.loads[:, :2].T
    return np.degrees(np.arctan2(a * d - b * c, a * c + b * d))


FRICTION, MOMENT = "friction over nominal", "moment less nominal [N mm]"
pictures = (
    (
        "anisotropy-world:ratio=1.4,direction=0.5",
        "heading in W [deg]",
        FRICTION,
        lambda s: (s.heading, s.ratio),
    ),
    (
        "anisotropy-object:ratio=1.4,direction=0.5",
        "heading in B [deg]",
        FRICTION,
        lambda s: (s.heading_in_b, s.ratio),
    ),
    ("speed-dependence:slope=0.15", "speed [mm/s]", FRICTION, lambda s: (s.speed, s.ratio)),
    ("spatial-variation:gradient=1.0/0", "x on the table [m]", FRICTION, lambda s: (s.poses[:, 0], s.ratio)),
    ("drift:rate=-0.3", "number of the push", FRICTION, lambda s: (s.number, s.ratio)),
    (
        "pressure-shift:offset=0.008/0",
        "heading in B [deg]",
        MOMENT,
        lambda s: (s.heading_in_b, 1000 * s.left[:, 2]),
    ),
    (
        "pressure-spread:scale=1.4",
        "nominal moment [N mm]",
        "moment [N mm]",
        lambda s: (1000 * s.nominal[:, 2], 1000 * s.loads[:, 2]),
    ),
    ("tilt:slope=0.05/0.02", "force in W less nominal: x [N]", "y [N]", lambda s: s.left_in_w.T),
    ("force-bias:force=0.5/0.2", "force in W less nominal: x [N]", "y [N]", lambda s: s.left_in_w.T),
    (
        "force-rotation:angle=0.15",
        "number of the push",
        "force turned by [deg]",
        lambda s: (s.number, turned(s)),
    ),
    ("frame-offset:offset=0.008/0", "fy [N]", MOMENT, lambda s: (s.loads[:, 1], 1000 * s.left[:, 2])),
    ("latency:delay=0.1", "speed [mm/s]", "clearance of the finger [mm]", lambda s: (s.speed, s.depth)),
    (
        "contact-geometry:radius=0.006",
        "number of the push",
        "clearance of the finger [mm]",
        lambda s: (s.number, s.depth),
    ),
    (
        "contact-friction:mu=0.3",
        "direction off the normal [deg]",
        "tangential / normal force",
        lambda s: (directions[s.number - 1], s.slant),
    ),
    ("inertia:mass=3", "time in the fastest push [s]", "force [N]", lambda s: s.fastest),
)

clean = Seen()
figure, axes = plt.subplots(5, 3, figsize=(8.6, 13), layout="constrained")
for shown, (words, x, y, values) in zip(axes.flat, pictures, strict=True):
    seen, name = Seen(words), words.split(":")[0]
    line = "o-" if name == "inertia" else "o"
    shown.plot(*values(clean), line, color="0.6", markersize=3)
    shown.plot(*values(seen), line, color="#D55E00", markersize=3)
    if name in ("tilt", "force-bias"):
        shown.plot(*seen.rest.T, "x", color="#0072B2", markersize=5, label="at rest")
        shown.legend(fontsize=8)
    shown.set(xlabel=x, ylabel=y)
    shown.set_title(name, fontsize=11)
    if name == "inertia":
        continue
    # pushes that turn about a foot may be far off
    low, high = np.quantile(np.concatenate([np.ravel(values(s)[1]) for s in (clean, seen)]), (0.02, 0.98))
    shown.set_ylim(low - 0.15 * (high - low), high + 0.15 * (high - low))
print(f"{len(pictures)} effects, {len(pushes)} pushes each")
figure.savefig("signatures.png")
