"""The offset of a force sensor in records of pushes that follow each other: rests, fingers that press on, transfers."""

from itertools import pairwise

import numpy as np
import pytest

import stablepush as sp
from stablepush.geometry import compose, exp, rotate_vectors, transform_points

# that some pushes have no rest of their own is noted
pytestmark = pytest.mark.filterwarnings("ignore::stablepush.StablepushWarning")

SLIDER, RADIUS = sp.Slider.rectangle(0.10, 0.06, 0.8), 0.005
RIG = sp.Rig(SLIDER, finger_radius=RADIUS)
OFFSET = np.array((0.35, -0.25))
LOW, HIGH = (0.01, -0.03 - RADIUS), (-0.01, 0.03 + RADIUS)
#: Pushes: name, twist for a second, place of the finger in B and load in B.
PUSHES = (
    ("a", (0.002, 0.02, 0.1), LOW, (0.2, 2.0)),
    ("b", (-0.003, 0.02, -0.2), LOW, (-0.3, 2.0)),
    ("c", (0.0, 0.02, 0.15), LOW, (0.1, 2.0)),
    ("d", (0.001, -0.02, 0.1), HIGH, (0.25, -1.9)),
)


class Record:
    """Rows of a record at 100 Hz, in W: pose, tip, heading of the tool, force, and the trial."""

    def __init__(self):
        self.pose, self.tool, self.rows, self.names = np.zeros(3), 0.3, [], []

    def at(self, place):
        return transform_points(self.pose[None], np.array([place]))[0, 0]

    def free(self, name, ways, turn=0.0):
        """Half a second from each way point in B to the next, the tool turning by ``turn`` in all."""
        places = np.concatenate([np.linspace(self.at(a), self.at(b), 50) for a, b in pairwise(ways)])
        headings = self.tool + np.linspace(0.0, turn, len(places))
        self._add(name, np.tile(self.pose, (len(places), 1)), places, headings, np.zeros((len(places), 2)))

    def push(self, name, twist, place, load, seconds=1.0):
        """With a constant body twist and load; of a twist of zero: a finger that presses."""
        poses = compose(self.pose, exp(np.array(twist) * np.linspace(0.0, 1.0, round(100 * seconds))[:, None]))
        tips = transform_points(poses, np.array([place]))[:, 0]
        headings = self.tool + poses[:, 2] - self.pose[2]
        self._add(name, poses, tips, headings, rotate_vectors(poses[:, 2], np.tile(load, (len(poses), 1))))

    def _add(self, name, poses, tips, headings, forces):
        self.rows.append(np.column_stack((poses, tips, headings, forces)))
        self.names += [name] * len(poses)
        self.pose, self.tool = poses[-1], float(headings[-1])

    def log(self, turns_with_tool=False, headings=True, drift=0.0):
        rows = np.concatenate(self.rows)
        t, heading = 0.01 * np.arange(len(rows)), rows[:, 5]
        offset = rotate_vectors(heading - heading[0] if turns_with_tool else 0 * heading, np.tile(OFFSET, (len(t), 1)))
        noise = 0.01 * np.random.default_rng(2).normal(size=(len(t), 2))
        last = np.array(self.names) == "d"
        forces = rows[:, 6:] + offset + noise + drift * last[:, None]
        return sp.log_from_arrays(RIG, t, rows[:, :3], forces, rows[:, 3 : 6 if headings else 5], self.names)


def executed(turn=1.2):
    """Three pushes of one contact, with pauses in which the finger presses, a transfer, a push from above, and the retract."""
    made = Record()
    made.free("a", ((0.01, -0.08), (0.01, -0.08), LOW))
    for name, twist, place, load in PUSHES:
        if name == "d":
            made.free(name, (LOW, (0.01, -0.08), (0.12, -0.08), (0.12, 0.08), (-0.01, 0.08), HIGH), turn)
        elif name != "a":
            made.push(name, (0.0, 0.0, 0.0), place, load, 0.15)
        made.push(name, twist, place, load)
    made.free("", (HIGH, (-0.01, 0.09)))
    return made


def read_in_push(log, name):
    rows = log.rows(name)
    return np.median(log.columns("fx", "fy")[rows[log.samples["phase"][rows] == "push"]], axis=0)


@pytest.mark.parametrize("turns_with_tool", (False, True))
@pytest.mark.parametrize("headings", (True, False))
def test_the_first_rest_serves_pushes_that_follow_without_one(turns_with_tool, headings):
    log = executed(1.2 if headings else 0.0).log(turns_with_tool, headings)
    for name, _, _, load in PUSHES:
        # within a push the tool turns by up to 0.2 rad
        assert read_in_push(log, name) == pytest.approx(load, abs=0.07 if turns_with_tool else 0.03), name
    assert not (log.samples["phase"][log.rows("b")] == "rest").any()


def test_a_finger_that_presses_on_beside_another_load_is_not_at_rest():
    """The pause has the load of the push before it; the next push has another one, so the force steps between them."""
    made = Record()
    made.free("a", ((0.01, -0.08), (0.01, -0.08), LOW))
    made.push("a", *PUSHES[0][1:])
    made.push("b", (0.0, 0.0, 0.0), LOW, (0.2, 2.0), 0.15)
    made.push("b", (0.01, 0.01, 0.3), LOW, (1.2, 1.3))
    log = made.log()
    # one rest does not show whether the offset turns with the tool, which turns by 0.2 rad
    assert read_in_push(log, "b") == pytest.approx((1.2, 1.3), abs=0.1)
    assert (log.samples["phase"][log.rows("b")] == "approach").sum() >= 10


def test_a_transfer_is_no_push():
    log = executed().log()
    phases = log.samples["phase"][log.rows("d")]
    assert (phases == "rest").sum() > 150 and 60 < (phases == "push").sum() < 130


def test_a_finger_that_touches_at_rest_shows_the_offset_of_its_own_trial():
    """Pokes whose finger waits at the outline, and a sensor that has drifted by 3 N between them."""
    made = Record()
    for name in ("a", "d"):
        made.free(name, (LOW, LOW))
        made.push(name, *PUSHES[0][1:])
    log = made.log(drift=3.0, headings=False)
    for name in ("a", "d"):
        assert read_in_push(log, name) == pytest.approx((0.2, 2.0), abs=0.03)


def test_clocks_that_begin_anew_in_each_trial():
    made = Record()
    for name in ("a", "d"):
        made.free(name, (LOW, LOW))
        made.push(name, *PUSHES[0][1:])
    rows, names = np.concatenate(made.rows), np.array(made.names)
    clock = np.concatenate([0.01 * np.arange((names == name).sum()) for name in ("a", "d")])
    forces = rows[:, 6:] + OFFSET + 2.0 * (names == "d")[:, None]
    log = sp.log_from_arrays(RIG, clock, rows[:, :3], forces, rows[:, 3:5], made.names)
    for name in ("a", "d"):
        assert read_in_push(log, name) == pytest.approx((0.2, 2.0), abs=0.01)


def test_the_offset_turns_with_the_tool_during_a_push():
    """Rests at one heading do not tell whether it does; a sensor on the tool is what nearly all have."""
    made = Record()
    for name in ("a", "d"):
        made.tool = 0.3
        made.free(name, (LOW, LOW))
        made.push(name, (0.002, 0.02, 0.8), LOW, (0.2, 2.0))
    log = made.log(turns_with_tool=True)
    for name in ("a", "d"):
        rows = log.rows(name)
        pushed = rows[log.samples["phase"][rows] == "push"]
        read = log.columns("fx", "fy")[pushed[-10:]].mean(axis=0)
        assert read == pytest.approx((0.2, 2.0), abs=0.02)


@pytest.mark.filterwarnings("error::stablepush.StablepushWarning")
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("tools", ((0.3, 1.4, -0.9, 2.2), (np.pi - 1e-3, 1e-3 - np.pi, np.pi - 2e-3, -np.pi)))
def test_noise_of_a_zeroed_sensor_does_not_fix_its_offset_in_the_world(tools, seed):
    made, rng = Record(), np.random.default_rng(seed)
    for name, tool in zip("abcd", tools, strict=True):
        made.tool = tool
        made.free(name, ((0.0, -0.08), LOW))
        made.push(name, (0.0, 0.02, 0.0), LOW, (0.2, 2.0))
    rows = np.concatenate(made.rows)
    forces = rows[:, 6:] + 0.02 * rng.normal(size=(len(rows), 2))
    sp.log_from_arrays(RIG, 0.01 * np.arange(len(rows)), rows[:, :3], forces, rows[:, 3:6], made.names)


def test_an_offset_that_does_not_turn_with_the_tool_is_told():
    made = Record()
    for name, tool in zip("abcd", (0.3, 1.4, -0.9, 2.2), strict=True):
        made.tool = tool
        made.free(name, ((0.0, -0.08), LOW))
        made.push(name, (0.0, 0.02, 0.0), LOW, (0.2, 2.0))
    with pytest.warns(sp.StablepushWarning, match="does not turn with the tool"):
        log = made.log()
    for name in "abcd":
        assert read_in_push(log, name) == pytest.approx((0.2, 2.0), abs=0.03)


def test_a_moment_that_is_missing_at_rest_leaves_the_others():
    made = executed()
    rows = np.concatenate(made.rows)
    moments = np.full(len(rows), 0.01)
    moments[3] = np.nan
    log = sp.log_from_arrays(
        RIG, 0.01 * np.arange(len(rows)), rows[:, :3], rows[:, 6:], rows[:, 3:6], made.names, moments=moments
    )
    assert np.isfinite(log.columns("tau")[log.samples["phase"] == "push"]).all()


@pytest.mark.parametrize("noise", (0.0, 1e-4))
def test_a_push_lasts_until_the_tip_stops(noise):
    """Also one that ends with a turn about the tip, and a short one of a tip whose place is known to 0.1 mm."""
    rng = np.random.default_rng(5)
    for twists in (((0.0, 0.005, 0.0),), ((0.0, 0.02, 0.0), (-0.3 * (0.03 + RADIUS), 0.0, 0.3))):
        made = Record()
        made.free("a", ((0.0, -0.08), (0.0, -0.08), (0.0, -0.03 - RADIUS)))
        for twist in twists:
            made.push("a", twist, (0.0, -0.03 - RADIUS), (0.2, 2.0))
        moved = 100 + 100 * len(twists)
        made.push("a", (0.0, 0.0, 0.0), (0.0, -0.03 - RADIUS), (0.1, 1.0))
        made.rows = [np.concatenate(made.rows)]
        made.rows[0][:, 3:5] += noise * rng.normal(size=(len(made.names), 2))
        phases = made.log().samples["phase"]
        ended = int(np.flatnonzero(phases == "push")[-1])
        assert moved - 12 <= ended <= moved + 5


def test_a_slider_that_moves_is_touched():
    """Where an object was lost, the geometry of fingers that are believed elsewhere says that they are away: no rest is there."""
    made = Record()
    made.free("a", ((0.01, -0.08), (0.01, -0.08), LOW))
    made.push("a", *PUSHES[0][1:])
    made.push("b", (0.0, 0.002, 0.0), (0.01, -0.05), (0.2, 1.5), 0.5)
    made.push("b", (0.0, 0.02, 0.0), LOW, (0.9, 1.9))
    log = made.log()
    assert not (log.samples["phase"][log.rows("b")] == "rest").any()
    assert read_in_push(log, "b")[1] > 1.4
