"""Pushes that are known in closed form, as a tracker, a robot and a force sensor see them from the world."""

import json

import numpy as np
import yaml

import stablepush as sp
from stablepush.cli import main
from stablepush.geometry import compose, exp, rotate_vectors, transform_points
from stablepush.io import slider_to_json

SLIDER = sp.Slider.rectangle(0.10, 0.06, 0.8)
RADIUS = 0.005


def recorded(count=3, rate=100.0, twist=(0.002, 0.02, 0.1), offset=(0.0, 0.0, 0.0)):
    """Pushes at the lower edge: a second at rest, half a second with a constant body twist and load; in the world.

    Returns the columns and, of each push, the load in B.
    """
    rng = np.random.default_rng(4)
    t, poses, tips, forces, trials, loads = [], [], [], [], [], []
    for k in range(count):
        start = np.array((*rng.uniform(-0.3, 0.3, 2), rng.uniform(-3, 3)))
        place = np.array((rng.uniform(-0.04, 0.04), -0.03))
        force = np.array((0.3 * rng.uniform(-1, 1), 2.0))
        clock = np.arange(round(1.5 * rate) + 1) / rate
        moving = np.maximum(clock - 1.0, 0.0)
        body = compose(start, exp(np.array(twist) * moving[:, None]))
        finger = transform_points(body, (place - (0.0, RADIUS))[None])[:, 0]
        acting = np.where((clock >= 1.0)[:, None], rotate_vectors(body[:, 2], np.tile(force, (len(clock), 1))), 0.0)
        t.append(100.0 + 10.0 * k + clock)
        poses.append(compose(body, offset))
        tips.append(finger)
        forces.append(acting)
        trials += [f"p{k}"] * len(clock)
        loads.append((*force, place[0] * force[1] - place[1] * force[0]))
    return [np.concatenate(part) for part in (t, poses, tips, forces)], trials, np.array(loads)


RIG = {"finger_radius": RADIUS, "friction": {"support": None, "contact": 0.5}}


def slider_file(folder, slider=SLIDER):
    path = folder / "slider.json"
    path.write_text(json.dumps(slider_to_json(slider)), encoding="utf-8")
    return path


def mapping_file(folder, **entries):
    path = folder / "mapping.yaml"
    slider_file(folder)
    path.write_text(yaml.safe_dump({"slider": "slider.json", **RIG, **entries}), encoding="utf-8")
    return path


def imported(capsys, *arguments):
    code = main(["import", *map(str, arguments)])
    assert code == 0, capsys.readouterr().err
