"""Recordings in the world frame become body-frame rows: a motion that is known in closed form, seen from the world."""

import warnings
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from recordings import RADIUS, SLIDER, recorded

import stablepush as sp
from stablepush.geometry import compose, exp, inverse, rotate_vectors, transform_points
from stablepush.io import end_of_motion


def test_loads_and_twists_are_those_of_the_motion():
    (t, poses, tips, forces), trials, loads = recorded()
    pairs = sp.pokes_from_world(poses, tips, forces, t, SLIDER, trials, window=0.02)
    assert pairs.trials == ["p0", "p1", "p2"]
    assert pairs.wrenches == pytest.approx(loads, abs=1e-12)
    # the first row of contact is half at rest: a share of it in 51
    assert pairs.twists == pytest.approx(np.tile((0.002, 0.02, 0.1), (3, 1)), rel=0.011, abs=1e-6)
    # the same without names: pushes are told apart by their contact
    again = sp.pokes_from_world(poses, tips, forces, t, SLIDER, window=0.02)
    assert again.wrenches == pytest.approx(pairs.wrenches, abs=1e-12)
    assert again.trials == ["1", "2", "3"]


def test_twists_are_exact_within_the_push_and_poses_everywhere():
    (t, poses, tips, forces), trials, _ = recorded(twist=(0.004, 0.02, 0.0))
    log = sp.log_from_arrays(sp.Rig(SLIDER, finger_radius=RADIUS), t, poses, forces, tips, trials, window=0.02)
    push = log.samples["phase"] == "push"
    assert push.sum() == 3 * 51
    inside = push & (log.samples["t"] > 1.015)
    assert log.columns("vx", "vy", "omega")[inside] == pytest.approx(np.tile((0.004, 0.02, 0.0), (inside.sum(), 1)), abs=1e-12)
    assert log.columns("x", "y", "theta") == pytest.approx(poses, abs=1e-12)
    assert log.columns("c1y")[push] == pytest.approx(-0.03, abs=1e-12)
    assert log.trials["start_time"] == pytest.approx([0.0, 10.0, 20.0])
    # the pusher's axis is the inward normal at first touch
    first = np.flatnonzero(push)[0]
    assert log.samples["ptheta"][first] == pytest.approx(poses[first, 2] + np.pi / 2)


def test_a_tracked_frame_elsewhere_and_a_sensor_that_reads_the_reaction_with_an_offset():
    offset = np.array((0.03, -0.02, 0.7))
    (t, poses, tips, forces), trials, loads = recorded(offset=offset)
    read = 0.4 - forces
    # the pose of B in the tracked frame is the inverse of that of the tracked frame in B
    how = {"body_pose": inverse(offset), "window": 0.02}
    for sign in ("finger", "power"):
        pairs = sp.pokes_from_world(poses, tips, read, t, SLIDER, trials, forces_on=sign, **how)
        assert pairs.wrenches == pytest.approx(loads, abs=1e-9)


def test_moments_are_about_the_tip():
    (t, poses, tips, forces), trials, loads = recorded()
    moments = np.where(forces[:, 1] != 0, 0.05, 0.0)
    # the heading of the tool is not given: forces do not need it, where the fingers touch does
    with pytest.warns(sp.StablepushWarning, match="two fingers without the heading of the tool"):
        log = sp.log_from_arrays(sp.Rig(SLIDER, contact_kind="two-point"), t, poses, forces, tips, trials, moments=moments)
    push = log.samples["phase"] == "push"
    by_hand = loads[:, 2] + RADIUS * loads[:, 0] + 0.05
    assert log.samples["tau"][push].reshape(3, -1) == pytest.approx(np.tile(by_hand[:, None], 51), abs=1e-12)
    assert "c1x" not in log.samples


def test_pokes_around_a_slider_are_what_a_fit_takes():
    support = sp.SupportDistribution.from_polygon(SLIDER.vertices, 0.01)
    surface = sp.IdealLimitSurface(support, 2.0)
    rng = np.random.default_rng(2)
    t, poses, tips, forces, trials, loads, twists = [], [], [], [], [], [], []
    for k in range(12):
        edge = k % 4
        a, b = SLIDER.vertices[edge], SLIDER.vertices[(edge + 1) % 4]
        place = a + rng.uniform(0.2, 0.8) * (b - a)
        normal = np.array((-(b - a)[1], (b - a)[0])) / np.linalg.norm(b - a)
        force = normal + rng.uniform(-0.3, 0.3) * np.array((-normal[1], normal[0]))
        twist = 0.01 * surface.twist(np.array((*force, place[0] * force[1] - place[1] * force[0])))
        load = surface.wrench(twist)
        # the finger is where the line of the force meets its edge
        place = place + (load[2] - (place[0] * load[1] - place[1] * load[0])) / ((b - a) @ (load[1], -load[0])) * (b - a)
        clock = np.arange(30) / 60.0
        body = compose((0.1 * k, 0.0, 0.3 * k), exp(twist * clock[:, None]))
        t.append(clock)
        poses.append(body)
        tips.append(transform_points(body, (place - 0.004 * normal)[None])[:, 0])
        forces.append(rotate_vectors(body[:, 2], np.tile(load[:2], (len(clock), 1))))
        trials += [str(k)] * len(clock)
        loads.append(load)
        twists.append(twist)
    pairs = sp.pokes_from_world(*map(np.concatenate, (poses, tips, forces, t)), SLIDER, trials, zero_forces=False)
    assert pairs.wrenches == pytest.approx(np.array(loads), abs=1e-9)
    assert pairs.twists == pytest.approx(np.array(twists), rel=1e-3, abs=1e-6)
    fit = sp.fit_limit_surface(pairs, slider=SLIDER, seed=0)
    assert fit.surface.wrench((0.0, 1.0, 0.0))[1] == pytest.approx(2.0, rel=0.05)


BAD = [
    ({"times": np.zeros((3, 2))}, "times"),
    ({"poses": np.zeros((5, 3))}, "poses: expected shape"),
    ({"tip_positions": np.zeros((453, 4))}, "tip_positions: expected shape"),
    ({"forces": np.full((453, 2), np.inf)}, "forces: expected finite numbers"),
    ({"poses": np.zeros((453, 3))}, "expected at least one push, found none"),
    ({"trials": ["a"]}, "trials: expected 453 names"),
    ({"trials": 5}, "trials: expected a list of names, got int"),
    ({"zero_forces": "no"}, "zero_forces: expected True or False, got 'no'"),
    ({"rig": SLIDER}, "rig: expected a Rig, got Slider"),
    ({"forces_on": "table"}, "forces_on"),
    ({"window": 0.0}, "window"),
    ({"tip_positions": None}, "tip_positions"),
    ({"body_pose": (0.0, 0.0)}, "body_pose"),
    ({"poses": [["a"] * 3] * 453}, "poses: expected numbers"),
]


@pytest.mark.parametrize(("wrong", "words"), BAD, ids=[words[:20] for _, words in BAD])
def test_bad_arrays_are_named(wrong, words):
    (t, poses, tips, forces), _, _ = recorded()
    given = {"rig": sp.Rig(SLIDER), "times": t, "poses": poses, "forces": forces, "tip_positions": tips} | wrong
    with pytest.raises(sp.InputError, match=words):
        sp.log_from_arrays(**given)


def test_times_that_stand_still_are_named():
    (t, poses, tips, forces), trials, _ = recorded()
    t[7] = t[6]
    with pytest.raises(sp.InputError, match=r"times\[7\]: expected times that grow within trial p0"):
        sp.log_from_arrays(sp.Rig(SLIDER), t, poses, forces, tips, trials)


def test_missing_rows_stay_missing():
    (t, poses, tips, forces), trials, loads = recorded()
    poses[120] = np.nan
    log = sp.log_from_arrays(sp.Rig(SLIDER), t, poses, forces, tips, trials)
    assert np.isnan(log.columns("x", "vx", "fx")[120]).all()
    assert sp.pokes_from_world(poses, tips, forces, t, SLIDER, trials).wrenches == pytest.approx(loads, abs=1e-12)


def test_clocks_may_count_from_1970():
    (t, poses, tips, forces), trials, loads = recorded()
    pairs = sp.pokes_from_world(poses, tips, forces, t + 1.7e9, SLIDER, trials)
    assert pairs.wrenches == pytest.approx(loads, abs=1e-6)


def test_a_delay_of_the_poses_is_taken_off():
    (t, poses, tips, forces), trials, loads = recorded()
    right = sp.log_from_arrays(sp.Rig(SLIDER), t, poses, forces, tips, trials)
    late = np.concatenate([np.concatenate((part[:1].repeat(8, axis=0), part[:-8])) for part in np.split(poses, 3)])
    log = sp.log_from_arrays(sp.Rig(SLIDER), t, late, forces, tips, trials, pose_delay=0.08)
    for name in log.trials["trial"]:
        rows = log.rows(name)
        assert log.columns("x", "y", "theta")[rows][:-9] == pytest.approx(right.columns("x", "y", "theta")[rows][:-9], abs=1e-9)
        # what was recorded later is of no row
        assert np.isnan(log.columns("x")[rows][-7:]).all()
    assert log.pairs().wrenches == pytest.approx(loads, abs=1e-9)
    # without trials, and ahead: no pose is made up between two pushes
    early = np.concatenate([np.concatenate((part[8:], part[-1:].repeat(8, axis=0))) for part in np.split(poses, 3)])
    pairs = sp.pokes_from_world(early, tips, forces, t, SLIDER, pose_delay=-0.08)
    assert len(pairs.trials) == 3
    assert pairs.wrenches == pytest.approx(loads, abs=0.02)
    with pytest.raises(sp.InputError, match="pose_delay: expected less than a push lasts, got 2 s"):
        sp.log_from_arrays(sp.Rig(SLIDER), t, late, forces, tips, trials, pose_delay=2.0)
    with pytest.raises(sp.InputError, match="pose_delay: expected a number"):
        sp.log_from_arrays(sp.Rig(SLIDER), t, late, forces, tips, trials, pose_delay="80 ms")


@pytest.mark.parametrize("few", (1, 2, 3, 10))
def test_few_rows_before_contact_are_rest(few):
    (t, poses, tips, forces), trials, loads = recorded()
    # contact is after 100 rows of 151
    kept = np.arange(len(t)) % 151 >= 100 - few
    names = [name for name, there in zip(trials, kept, strict=True) if there]
    # one or two show no offset of a sensor, and the import says so
    doubted = pytest.warns(sp.StablepushWarning, match="fewer than 3 rows at rest") if few < 3 else nullcontext()
    with doubted:
        log = sp.log_from_arrays(sp.Rig(SLIDER), t[kept], poses[kept], forces[kept], tips[kept], names, window=0.02)
    for name in log.trials["trial"]:
        phases = log.samples["phase"][log.rows(name)]
        assert (phases[:few] == "rest").all() and (phases[few : few + 50] == "push").all()
    assert log.pairs().wrenches == pytest.approx(loads, abs=1e-9)


def test_rows_in_which_a_finger_has_stopped_and_presses_on_are_no_push():
    """0.4 s more at each end of a push of 0.5 s, with two thirds of the load; noise of a tracker in all rows."""
    rng = np.random.default_rng(6)
    (t, *places), _, loads = recorded()
    parts, names = [], []
    for k, push in enumerate(zip(*(np.split(part, 3) for part in places), strict=True)):
        body, tip, force = (np.concatenate((part, part[-1:].repeat(40, axis=0))) for part in push)
        force[-40:] *= 0.67
        parts.append((t[k * 151] + np.arange(191) / 100, body + rng.normal(size=body.shape) * (1e-4, 1e-4, 1e-3), tip, force))
        names += [f"p{k}"] * 191
    times, bodies, tips, forces = (np.concatenate(part) for part in zip(*parts, strict=True))
    log = sp.log_from_arrays(sp.Rig(SLIDER), times, bodies, forces, tips, names)
    for name in log.trials["trial"]:
        phases = log.samples["phase"][log.rows(name)]
        assert (phases[-38:] == "retract").all() and (phases[105:145] == "push").all()
    assert log.pairs().wrenches == pytest.approx(loads, abs=0.08)


def test_degrees_and_milliseconds_are_doubted():
    (t, poses, tips, forces), trials, _ = recorded(twist=(0.002, 0.02, 0.3))

    def doubts(*given):
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            sp.log_from_arrays(sp.Rig(SLIDER, finger_radius=RADIUS), *given, trials)
        return " ".join(str(one.message) for one in heard)

    assert not doubts(t, poses, forces, tips)
    assert "units (angle)?" in doubts(t, poses * (1, 1, 180 / np.pi), forces, tips)
    assert "rows are 10 s apart: units (time, length)?" in doubts(1000 * t, poses, forces, tips)
    assert "units (length)?" in doubts(t, poses * (1000, 1000, 1), forces, 1000 * tips)


def test_motions_that_slow_down_have_no_rows_in_which_they_stand():
    way = np.linspace(0.0, 1.0, 60)
    trapezoid = np.interp(way, (0, 0.1, 0.9, 1), (0, 0.05, 0.95, 1))
    profiles = {"steady": way, "slowing": 10 * way**3 - 15 * way**4 + 6 * way**5, "trapezoid": trapezoid}
    for profile in profiles.values():
        for count in (2, 3, 6, 12, 60):
            rows = np.linspace(0, 59, count).astype(int)
            poses = np.column_stack((0.03 * profile[rows], 0 * rows, 0.5 * profile[rows]))
            assert end_of_motion(poses, 0.05) == count
    still = np.concatenate((profiles["steady"], np.ones(30)))
    assert end_of_motion(np.column_stack((0.03 * still, 0 * still, 0 * still)), 0.05) == pytest.approx(60, abs=2)


def test_each_trial_has_its_own_zero():
    (t, poses, tips, forces), trials, loads = recorded()
    forces[151:302] += (3.4, 0.0)
    forces[302:] += (0.0, -4.5)
    for given in (trials, None):
        assert sp.pokes_from_world(poses, tips, forces, t, SLIDER, given).wrenches == pytest.approx(loads, abs=1e-9)


def test_a_push_without_rest_keeps_its_load():
    t = np.arange(0, 1, 0.01)
    poses = np.column_stack((0 * t, 0.02 * t, 0 * t))
    tips = poses[:, :2] - (0, 0.035)
    for force in (2 + t, 2 + 0 * t, 1 + 3 * t):
        with pytest.warns(sp.StablepushWarning, match=r"1 of 1 pushes \(a\) have fewer than 3 rows at rest within 60 s"):
            pairs = sp.pokes_from_world(poses, tips, np.column_stack((0 * t, force)), t, SLIDER, ["a"] * 100)
        assert pairs.wrenches[0, 1] == pytest.approx(force.mean(), rel=1e-9)


def test_a_slider_that_is_set_back_between_two_rows_begins_a_push():
    """Only rows of motion, one push after the other at one rate: no rest tells them apart, the jump does."""
    (_, poses, tips, forces), trials, loads = recorded()
    moving = forces.any(axis=1)
    clock = 0.01 * np.arange(moving.sum())
    arrays = (poses[moving], tips[moving], forces[moving], clock)
    names = np.array(trials)[moving]
    starts = clock[1:][names[1:] != names[:-1]]
    with pytest.warns(sp.StablepushWarning, match=f"jumps before t = {starts[0]:.4g}, {starts[1]:.4g} s"):
        found = sp.pokes_from_world(*arrays, SLIDER, zero_forces=False)
    assert found.wrenches == pytest.approx(loads, abs=1e-9)
    assert found.twists == pytest.approx(np.tile((0.002, 0.02, 0.1), (3, 1)), abs=1e-6)


def test_short_pushes_of_a_long_record_are_told_apart_in_noise():
    """Three pushes of a second in 75 s, with the noise of a tracker and of a sensor."""
    rng = np.random.default_rng(0)
    t = np.arange(0, 75, 0.01)
    moving = sum((np.clip(t - begin, 0.0, 1.0) for begin in (12.0, 37.0, 61.0)), 0 * t)
    pushed = sum(((t >= begin) & (t <= begin + 1.0) for begin in (12.0, 37.0, 61.0)), 0 * t)
    poses = np.column_stack((0 * t, 0.01 * moving, 0 * t)) + rng.normal(size=(len(t), 3)) * (5e-5, 5e-5, 5e-4)
    tips = np.column_stack((0 * t, 0.01 * moving - 0.035))
    forces = np.column_stack((0 * t, 2.0 * pushed)) + 0.3 + 0.02 * rng.normal(size=(len(t), 2))
    pairs = sp.pokes_from_world(poses, tips, forces, t, SLIDER)
    assert len(pairs.trials) == 3
    assert pairs.wrenches == pytest.approx(np.tile((0.0, 2.0, 0.0), (3, 1)), abs=0.03)
    assert pairs.twists[:, 1] == pytest.approx(0.01, rel=0.05)


def test_pokes_that_missed_or_stuck_are_left_out():
    rng = np.random.default_rng(1)
    (t, poses, tips, forces), trials, _ = recorded()
    # the second never touches, the third is held
    poses[151:], forces[151:302] = poses[151], 0.02 * rng.normal(size=(151, 2))
    poses[151:] += rng.normal(size=(302, 3)) * (5e-5, 5e-5, 5e-4)
    with pytest.warns(sp.StablepushWarning, match=r"in 2 of 3 pushes \(p1, p2\) the slider does not move"):
        pairs = sp.pokes_from_world(poses, tips, forces, t, SLIDER, trials)
    assert pairs.trials == ["p0"]
    with (
        pytest.raises(sp.InputError, match=r"expected the slider to move by 0\.3 mm in at least one poke"),
        pytest.warns(sp.StablepushWarning),
    ):
        sp.pokes_from_world(poses[151:], tips[151:], forces[151:], t[151:], SLIDER, trials[151:])


def test_forces_that_are_missing_and_arrays_that_are_swapped_are_told():
    (t, poses, tips, forces), trials, _ = recorded()
    no_force, no_load = "in 3 of 3 pushes .* the force is missing", "expected both where the slider moves, got none in 3 pokes"
    with pytest.warns(sp.StablepushWarning, match=no_force), pytest.raises(sp.InputError, match=no_load):
        sp.pokes_from_world(poses, tips, np.full_like(forces, np.nan), t, SLIDER, trials)
    with pytest.raises(sp.InputError, match="forces: expected forces"):
        sp.pokes_from_world(poses, tips, None, t, SLIDER, trials)
    with pytest.raises(sp.InputError, match="slider: expected a Slider, got ndarray"):
        sp.pokes_from_world(poses, tips, forces, t, SLIDER.vertices, trials)
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        sp.pokes_from_world(poses, forces, tips, t, SLIDER, trials, zero_forces=False)
    assert any("outside the slider's outline" in str(one.message) for one in heard)


def test_without_forces_the_motion_tells_the_phases():
    (t, poses, _, _), trials, _ = recorded()
    for given in (trials, None):
        log = sp.log_from_arrays(sp.Rig(SLIDER), t, poses, trials=given)
        assert len(log) == 3
        pushed = [(log.samples["phase"][log.rows(name)] == "push").sum() for name in log.trials["trial"]]
        assert pushed == pytest.approx([52, 52, 52], abs=6)


@pytest.mark.parametrize(
    "wrong", [{"times": []}, {"moments": 5.0}, {"moments": ["a"] * 453}, {"times": ["a"] * 453}, {"times": np.full(453, np.nan)}]
)
def test_worse_arrays_are_named_too(wrong):
    (t, poses, tips, forces), _, _ = recorded()
    given = {"times": t, "poses": poses, "forces": forces, "tip_positions": tips} | wrong
    with pytest.raises(sp.InputError, match=next(iter(wrong))):
        sp.log_from_arrays(sp.Rig(SLIDER), **given)


def test_two_fingers_have_contact_points_where_they_touch():
    """A tool with two fingers 40 mm apart in the middle of the lower edge, one of them off the end of the slider."""
    t = np.arange(0, 1, 0.01)
    poses = np.column_stack((0 * t, 0.02 * t, 0 * t))
    rig = sp.Rig(SLIDER, contact_kind="two-point", finger_radius=RADIUS)
    forces = np.column_stack((0 * t, 2.0 + 0 * t))
    for x, beyond in ((0.0, False), (0.035, True)):
        tips = np.column_stack((0 * t + x, 0.02 * t - 0.03 - RADIUS, 0.5 + 0 * t))
        with pytest.warns(sp.StablepushWarning, match="two fingers without moments"):
            log = sp.log_from_arrays(rig, t, poses, forces, tips, ["a"] * 100, finger_distance=0.04)
        # where between the fingers the force acts nobody measured
        assert np.isnan(log.columns("tau")).all() and log.columns("fy")[:, 0] == pytest.approx(2.0)
        # the tool faces along y: its own y axis points to minus x
        assert log.columns("c1x", "c1y") == pytest.approx(
            np.tile((np.nan, np.nan) if beyond else (0.02, -0.03), (100, 1)), nan_ok=True
        )
        assert log.columns("c2x", "c2y") == pytest.approx(np.tile((x - 0.02, -0.03), (100, 1)), abs=1e-12)
    # a tracker whose origin is 3 mm off: the fingers seem to hang in the air, or to be inside, and touch all the same
    for offset in (0.003, -0.003):
        tips = np.column_stack((0 * t, 0.02 * t - 0.03 - RADIUS, 0.0 * t))
        with pytest.warns(sp.StablepushWarning) as said:
            log = sp.log_from_arrays(
                rig, t, np.add(poses, (0, offset, 0)), forces, tips, ["a"] * 100, finger_distance=0.04, moments=0 * t
            )
        assert np.isfinite(log.columns("c1x", "c1y", "c2x", "c2y")).all()
        where = "away from it" if offset > 0 else "inside"
        assert any(f"more than 1 mm off the outline, up to 3 mm {where}" in str(note.message) for note in said)
    # fingers at a round face: their middle is deeper than they are
    angles = 2 * np.pi * (np.arange(40) + 0.5) / 40
    round_one = sp.Slider(0.06 * np.stack((np.cos(angles), np.sin(angles)), axis=-1))
    depth = np.sqrt((0.06 + RADIUS) ** 2 - 0.02**2)
    tips = np.column_stack((0 * t, 0.02 * t - depth, 0.0 * t))
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        log = sp.log_from_arrays(
            replace(rig, slider=round_one), t, poses, forces, tips, ["a"] * 100, finger_distance=0.04, moments=0 * t
        )
    assert np.isfinite(log.columns("c1x", "c2x")).all() and not any("off the outline" in str(w.message) for w in heard)
    with pytest.raises(sp.InputError, match="finger_distance: expected a rig of kind two-point"):
        sp.log_from_arrays(sp.Rig(SLIDER), t, poses, forces, tips, finger_distance=0.04)


@pytest.mark.parametrize(
    ("turn", "words"), [(1.2, "more than 50 degrees off the normal"), (0.75, "turned by 43 degrees counter-clockwise"), (0.4, "")]
)
def test_forces_that_no_friction_turns_so_far_are_noted(turn, words):
    (t, poses, tips, forces), trials, _ = recorded(count=9)
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        sp.log_from_arrays(sp.Rig(SLIDER, finger_radius=RADIUS), t, poses, rotate_vectors(np.asarray(turn), forces), tips, trials)
    found = [str(warning.message) for warning in heard if "normal of the touched edge" in str(warning.message)]
    assert len(found) == (1 if words else 0)
    assert all(words in line and "force_angle" in line for line in found)


@pytest.mark.parametrize("angle", (35.0, -10.0, 12.5))
def test_degrees_for_the_angle_of_a_sensor_are_noted(angle):
    (t, poses, tips, forces), trials, _ = recorded()
    with pytest.warns(sp.PlausibilityWarning, match="force_angle: .*degrees"), warnings.catch_warnings():
        warnings.simplefilter("ignore", sp.StablepushWarning)
        warnings.simplefilter("default", sp.PlausibilityWarning)
        sp.log_from_arrays(sp.Rig(SLIDER, finger_radius=RADIUS), t, poses, forces, tips, trials, force_angle=angle)


def test_rows_that_are_far_apart_are_noted():
    """One row in 0.8 s: twists are slopes from row to row, in a window of the usual width."""
    (t, poses, tips, forces), trials, _ = recorded()
    kept = np.arange(len(t)) % 151 % 20 == 10
    names = [name for name, there in zip(trials, kept, strict=True) if there]
    with pytest.warns(sp.StablepushWarning, match=r"poses are 0.8 s apart, and twists are slopes from row to row"):
        log = sp.log_from_arrays(sp.Rig(SLIDER), 4 * t[kept], poses[kept], forces[kept], tips[kept], names)
    assert log.rig.twist_window == 0.1
