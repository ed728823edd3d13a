import numpy as np
import scipy.linalg
from hypothesis import given, strategies as st

from stablepush.geometry import se2

number = st.floats(-10, 10, allow_nan=False)
pose = st.tuples(number, number, number)
turn = st.one_of(st.floats(-6.2, 6.2), st.floats(-1e-9, 1e-9))


def matrix(p):
    c, s = np.cos(p[2]), np.sin(p[2])
    return np.array(((c, -s, p[0]), (s, c, p[1]), (0, 0, 1)))


@given(pose, pose)
def test_compose_is_the_product_of_matrices(a, b):
    np.testing.assert_allclose(matrix(se2.compose(a, b)), matrix(a) @ matrix(b), atol=1e-12)


@given(pose)
def test_inverse_undoes(p):
    np.testing.assert_allclose(se2.compose(p, se2.inverse(p)), np.zeros(3), atol=1e-12)


@given(number, number, turn)
def test_exp_is_the_matrix_exponential(x, y, omega):
    generator = np.array(((0, -omega, x), (omega, 0, y), (0, 0, 0)))
    np.testing.assert_allclose(matrix(se2.exp((x, y, omega))), scipy.linalg.expm(generator), atol=1e-9)


@given(number, number, turn)
def test_log_undoes_exp(x, y, omega):
    np.testing.assert_allclose(se2.log(se2.exp((x, y, omega))), (x, y, omega), atol=1e-8)


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_point_the_same_way(angle):
    wrapped = float(se2.wrap_angle(angle))
    assert -np.pi < wrapped <= np.pi
    assert abs(np.exp(1j * wrapped) - np.exp(1j * angle)) < 1e-10


def test_points_and_vectors_broadcast():
    poses = np.array(((0, 0, np.pi / 2), (1, 2, 0)))
    placed = se2.transform_points(poses, [[1.0, 0.0], [0.0, 1.0]])
    np.testing.assert_allclose(placed, [[[0, 1], [-1, 0]], [[2, 2], [1, 3]]], atol=1e-15)
    np.testing.assert_allclose(se2.rotate_vectors(np.pi / 2, [1.0, 0.0]), [0, 1], atol=1e-15)
