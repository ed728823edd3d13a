import numpy as np
import pytest
from hypothesis import given, strategies as st

from stablepush import InputError
from stablepush.geometry import planar

number = st.floats(-5, 5, allow_nan=False)
triple = st.tuples(number, number, number)


@given(number, number, st.sampled_from((-1.0, 1.0)))
def test_a_cor_rests_and_comes_back(x, y, sense):
    twist = planar.twist_from_cor((x, y), sense)
    np.testing.assert_allclose(planar.point_velocity(twist, [(x, y)]), 0, atol=1e-12)
    cor, found = planar.cor_from_twist(twist)
    np.testing.assert_allclose(cor, (x, y), atol=1e-12)
    assert found == sense


@given(triple, triple, triple)
def test_transport_keeps_power(wrench, twist, pose):
    moved = planar.transport_wrench(wrench, pose) @ planar.transport_twist(twist, pose)
    assert moved == pytest.approx(np.dot(wrench, twist), abs=1e-9)


@given(triple, triple)
def test_transported_twist_moves_points_alike(twist, pose):
    """The velocity of the frame's own origin is the twist's linear part, turned into the other frame."""
    moved = planar.transport_twist(twist, pose)
    velocity = planar.point_velocity(moved, [pose[:2]])[0]
    c, s = np.cos(pose[2]), np.sin(pose[2])
    np.testing.assert_allclose(velocity, (c * twist[0] - s * twist[1], s * twist[0] + c * twist[1]), atol=1e-9)


def test_translation_has_its_cor_at_infinity():
    _, sense = planar.cor_from_twist((1.0, 0.0, 0.0))
    assert sense == 0


@pytest.mark.parametrize("size", (1e-200, 1.0, 1e200))
def test_unit_keeps_direction_at_every_scale(size):
    np.testing.assert_allclose(planar.unit(np.array((3.0, 0.0, 4.0)) * size), (0.6, 0, 0.8))


def test_angles_are_exact_where_arccos_is_not():
    assert planar.angle_between((1, 0, 0), (1, 1e-9, 0)) == pytest.approx(1e-9, rel=1e-6)
    assert planar.angle_between((1, 0, 0), (-1, 0, 0)) == pytest.approx(np.pi)


@pytest.mark.parametrize("sense", (0, 2, [1, 0]))
def test_a_wrong_sense_is_refused(sense):
    with pytest.raises(InputError, match="sense"):
        planar.twist_from_cor((0.0, 1.0), sense)
