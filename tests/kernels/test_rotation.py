import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from replay.kernels import rotation

angles = st.floats(-np.pi, np.pi)
pitches = st.floats(-1.5, 1.5)
components = st.floats(-3.0, 3.0)


def as_scipy(q: np.ndarray) -> Rotation:
    return Rotation.from_quat([q[1], q[2], q[3], q[0]])


@given(components, components, components)
def test_quaternion_of_a_vector_is_scipys(x, y, z):
    q = np.zeros(4)
    rotation.quaternion_from_vector(x, y, z, q)
    expected = Rotation.from_rotvec([x, y, z]).as_matrix()
    np.testing.assert_allclose(as_scipy(q).as_matrix(), expected, atol=4e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.1, 0.49999, 0.5, 0.50001, 1.0, 6.0])
def test_half_angle_terms_join_smoothly(angle):
    c, s = rotation.half_angle_terms(angle * angle)
    assert c == pytest.approx(np.cos(angle / 2), abs=3e-16)
    expected = 0.5 if angle == 0.0 else np.sin(angle / 2) / angle
    assert s == pytest.approx(expected, rel=4e-16)


@given(components, components, components, components, components, components)
def test_products_compose_as_matrices_do(a, b, c, d, e, f):
    p, q, product = np.zeros(4), np.zeros(4), np.zeros(4)
    rotation.quaternion_from_vector(a, b, c, p)
    rotation.quaternion_from_vector(d, e, f, q)
    rotation.quaternion_multiply(p, q, product)
    P, Q, PQ, expected = (np.zeros((3, 3)) for _ in range(4))
    rotation.matrix_from_quaternion(p, P)
    rotation.matrix_from_quaternion(q, Q)
    rotation.matrix_from_quaternion(product, PQ)
    rotation.multiply3(P, Q, expected)
    np.testing.assert_allclose(PQ, expected, atol=5e-15)


@given(angles, angles, angles)
def test_matrix_to_quaternion_and_back(x, y, z):
    C = Rotation.from_euler("zyx", [x, y, z]).as_matrix()
    q, back = np.zeros(4), np.zeros((3, 3))
    rotation.quaternion_from_matrix(C, q)
    rotation.matrix_from_quaternion(q, back)
    np.testing.assert_allclose(back, C, atol=4e-15)


@given(angles, pitches, angles)
def test_euler_angles_are_heading_pitch_roll(roll, pitch, heading):
    C = np.zeros((3, 3))
    rotation.matrix_from_euler(roll, pitch, heading, C)
    # Intrinsic heading, pitch, roll from north-east-down: scipy's matrix is C_b_n.
    expected = Rotation.from_euler("ZYX", [heading, pitch, roll]).as_matrix()
    np.testing.assert_allclose(C, expected, atol=3e-16 * 10)
    back = rotation.euler_from_matrix(C)
    assert back[0] == pytest.approx(roll, abs=1e-12)
    assert back[1] == pytest.approx(pitch, abs=1e-12)
    wrapped = heading % (2 * np.pi)
    assert min(abs(back[2] - wrapped), 2 * np.pi - abs(back[2] - wrapped)) < 1e-12


def test_heading_is_clockwise_from_north():
    C = np.zeros((3, 3))
    rotation.matrix_from_euler(0.0, 0.0, np.pi / 2, C)
    np.testing.assert_allclose(C @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-16)  # forward: east


def test_pitch_up_lifts_the_nose_and_roll_lowers_the_right_side():
    C = np.zeros((3, 3))
    rotation.matrix_from_euler(0.0, 0.1, 0.0, C)
    assert (C @ [1.0, 0.0, 0.0])[2] < 0.0
    rotation.matrix_from_euler(0.1, 0.0, 0.0, C)
    assert (C @ [0.0, 1.0, 0.0])[2] > 0.0


@given(angles, pitches, angles, components, components, components)
def test_rotating_back_undoes_rotating(roll, pitch, heading, x, y, z):
    C = np.zeros((3, 3))
    rotation.matrix_from_euler(roll, pitch, heading, C)
    there = rotation.rotate3(C, x, y, z)
    np.testing.assert_allclose(there, C @ [x, y, z], atol=1e-14)
    np.testing.assert_allclose(rotation.rotate3_back(C, *there), [x, y, z], atol=1e-14)
    np.testing.assert_allclose(
        rotation.cross3(x, y, z, *there), np.cross([x, y, z], there), atol=1e-13
    )
