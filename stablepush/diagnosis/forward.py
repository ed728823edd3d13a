"""What a rig's sensors would read for the motions of a log: the nominal simulation with effects, linear in the support's
loads."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stablepush._arrays import FloatArray
from stablepush.diagnosis.observations import Observations
from stablepush.effects import REFERENCE_SPEED
from stablepush.se2 import compose, exp, rotate_vectors

#: Speeds (m/s) below which friction depends on speed no more.
_SLOWEST = 1e-5
#: Parameters of effects that change the wrench, as they enter: near zero for no effect.
#: anisotropy: ``(a, b)``, squares of the frictions being ``1 ± √(a² + b²)`` over their mean, the greater along ``atan2(b, a)/2``.
PARAMETERS: Mapping[str, int] = {
    "anisotropy-world": 2,
    "anisotropy-object": 2,
    "speed-dependence": 1,
    "spatial-variation": 2,
    "drift": 1,
    "pressure-shift": 2,
    "pressure-spread": 1,
    "tilt": 2,
    "inertia": 1,
    "force-bias": 2,
    "force-rotation": 1,
    "frame-offset": 2,
    "latency": 1,
}
#: Sizes of the parameters that count as small, for differences.
SMALL: Mapping[str, float] = {
    "anisotropy-world": 0.01,
    "anisotropy-object": 0.01,
    "speed-dependence": 0.01,
    "spatial-variation": 0.05,
    "drift": 0.01,
    "pressure-shift": 2e-4,
    "pressure-spread": 0.01,
    "tilt": 1e-3,
    "inertia": 0.05,
    "force-bias": 0.01,
    "force-rotation": 0.005,
    "frame-offset": 2e-4,
    "latency": 5e-3,
}

Values = Mapping[str, FloatArray]


class ForwardModel:
    """Predicted wrenches of the rows of a log, in the tracked frame.

    Parameters
    ----------
    observations : Observations
    points : array, shape (k, 2)
        Support points in B.
    weight : float
        ``m g`` in N: what a slope of the table pulls with.
    inertia : float
        Moment of inertia over the mass, in m².
    center : array, shape (2,)
        Nominal centre of pressure in B, about which pressure spreads.
    """

    def __init__(self, observations: Observations, points: FloatArray, weight: float, inertia: float, center: FloatArray) -> None:
        self._o, self._points, self._weight, self._inertia, self._center = observations, points, weight, inertia, center
        known = np.isfinite(observations.pusher).all(axis=1)
        # without a pusher pose the sensor is taken to sit at the contact, else at the origin
        place = observations.pose[:, :2].copy()
        touching = np.isfinite(observations.place[:, 0]).all(axis=1)
        at = observations.pose[:, :2] + rotate_vectors(observations.pose[:, 2], np.nan_to_num(observations.place[:, 0]))
        place[touching] = at[touching]
        place[known] = observations.pusher[known, :2]
        self._place = place

    def matrix(self, values: Values) -> tuple[FloatArray, FloatArray]:
        """Return ``G`` (n, 3, k) and ``c`` (n, 3): the measured wrenches are ``G m + c`` for friction loads ``m`` (k,) in N."""
        o, points = self._o, self._points
        offset = values.get("frame-offset", np.zeros(2))
        delay = float(values.get("latency", np.zeros(1))[0])
        pose, twist = o.pose, o.twist
        if delay:
            pose, twist = compose(pose, exp(twist * delay)), twist + delay * o.acceleration
        if offset.any():
            shift = np.array((-offset[0], -offset[1], 0.0))
            pose = compose(pose, shift)
            twist = np.stack((twist[:, 0] + twist[:, 2] * offset[1], twist[:, 1] - twist[:, 2] * offset[0], twist[:, 2]), axis=-1)
        p = np.broadcast_to(points, (len(twist), *points.shape))
        if "pressure-spread" in values:
            p = self._center + (1 + float(values["pressure-spread"][0])) * (p - self._center)
        if "pressure-shift" in values:
            p = p + values["pressure-shift"]
        vx = twist[:, None, 0] - twist[:, None, 2] * p[..., 1]
        vy = twist[:, None, 1] + twist[:, None, 2] * p[..., 0]
        speed = np.sqrt(vx**2 + vy**2 + 1e-18)
        ex, ey = vx / speed, vy / speed
        share = np.ones_like(speed)
        for id, angle in (("anisotropy-world", pose[:, 2]), ("anisotropy-object", np.zeros(len(pose)))):
            if id in values:
                a, b = values[id]
                # e + D e - e (e·D e)/2 with the trace-free D turned into B, to first order; exact enough for ratios up to 1.5
                c2, s2 = np.cos(2 * angle)[:, None], np.sin(2 * angle)[:, None]
                dxx, dxy = a * c2 + b * s2, b * c2 - a * s2
                ax, ay = ex + dxx * ex + dxy * ey, ey + dxy * ex - dxx * ey
                # over the geometric mean of the two frictions
                size = np.sqrt(np.maximum(1e-12, ex * ax + ey * ay)) * max(1e-3, 1 - a * a - b * b) ** 0.25
                ex, ey = ax / size, ay / size
        if "speed-dependence" in values:
            share = share * (1 + float(values["speed-dependence"][0]) * np.log(np.maximum(speed, _SLOWEST) / REFERENCE_SPEED))
        if "spatial-variation" in values:
            g = values["spatial-variation"]
            cos, sin = np.cos(pose[:, 2])[:, None], np.sin(pose[:, 2])[:, None]
            x = pose[:, None, 0] + cos * p[..., 0] - sin * p[..., 1]
            y = pose[:, None, 1] + sin * p[..., 0] + cos * p[..., 1]
            share = share * (1 + g[0] * x + g[1] * y)
        if "drift" in values:
            share = share * (1 + float(values["drift"][0]) * o.order)[:, None]
        fx, fy = share * ex, share * ey
        columns = np.stack((fx, fy, p[..., 0] * fy - p[..., 1] * fx), axis=1)
        constant = np.zeros((len(pose), 3))
        if "tilt" in values:
            constant[:, :2] -= self._weight * rotate_vectors(-pose[:, 2], np.broadcast_to(values["tilt"], (len(pose), 2)))
        if "inertia" in values:
            mass = float(values["inertia"][0])
            turn = twist[:, 2:] * np.stack((-twist[:, 1], twist[:, 0]), axis=-1)
            constant[:, :2] += mass * (o.acceleration[:, :2] + turn)
            constant[:, 2] += mass * self._inertia * o.acceleration[:, 2]
        return self._sensed(values, pose, columns, constant)

    def _sensed(
        self, values: Values, pose: FloatArray, columns: FloatArray, constant: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """What a sensor at the pusher reads, computed into the tracked frame with the measured pose."""
        o = self._o
        loads = np.concatenate((columns, constant[..., None]), axis=2)
        cos, sin = np.cos(pose[:, 2])[:, None], np.sin(pose[:, 2])[:, None]
        fx, fy = cos * loads[:, 0] - sin * loads[:, 1], sin * loads[:, 0] + cos * loads[:, 1]
        arm = (pose[:, :2] - self._place)[..., None]
        moment = loads[:, 2] + arm[:, 0] * fy - arm[:, 1] * fx
        if "force-rotation" in values:
            c, s = np.cos(values["force-rotation"][0]), np.sin(values["force-rotation"][0])
            fx, fy = c * fx - s * fy, s * fx + c * fy
        if "force-bias" in values:
            fx, fy = fx.copy(), fy.copy()
            fx[:, -1] += values["force-bias"][0]
            fy[:, -1] += values["force-bias"][1]
        back = (self._place - o.pose[:, :2])[..., None]
        tau = moment + back[:, 0] * fy - back[:, 1] * fx
        cos, sin = np.cos(o.pose[:, 2])[:, None], np.sin(o.pose[:, 2])[:, None]
        sensed = np.stack((cos * fx + sin * fy, -sin * fx + cos * fy, tau), axis=1)
        return sensed[..., :-1], sensed[..., -1]

    def predict(self, loads: FloatArray, values: Values) -> FloatArray:
        """Return the wrenches (n, 3) for friction loads (k,)."""
        matrix, constant = self.matrix(values)
        return matrix @ loads + constant

    def motion_slopes(self, loads: FloatArray) -> FloatArray:
        """Return ``dF/dV`` (n, 3, 3) at the measured motions, by differences: how noise of the motion reaches the prediction."""
        o = self._o
        p = self._points
        result = np.zeros((len(o.twist), 3, 3))

        def load(twist: FloatArray) -> FloatArray:
            vx = twist[:, None, 0] - twist[:, None, 2] * p[:, 1]
            vy = twist[:, None, 1] + twist[:, None, 2] * p[:, 0]
            share = loads / np.sqrt(vx**2 + vy**2 + 1e-18)
            fx, fy = share * vx, share * vy
            return np.stack((fx.sum(1), fy.sum(1), (p[:, 0] * fy - p[:, 1] * fx).sum(1)), axis=-1)

        size = np.maximum(np.linalg.norm(o.twist[:, :2], axis=1), 1e-6)
        length = max(1e-3, float(np.sqrt((p**2).sum(axis=1).mean())))
        for k, scale in enumerate((1.0, 1.0, 1.0 / length)):
            step = np.zeros((len(size), 3))
            step[:, k] = 0.02 * size * scale
            result[:, :, k] = (load(o.twist + step) - load(o.twist - step)) / (2 * step[:, k])[:, None]
        return result
