"""Newton's method on batches of small systems: quadratic where it may be, safe where it must be."""

from __future__ import annotations

import numpy as np

from screwkin.algebra.newton import newton


def circle_and_line(targets):
    """x^2 + y^2 = r^2, y = x: solved at r/sqrt(2); the residual is target less value, so J dx = residual."""

    def residual(x, samples):
        r = np.stack([targets[samples] ** 2 - x[:, 0] ** 2 - x[:, 1] ** 2, x[:, 0] - x[:, 1]], axis=1)
        J = np.empty((len(x), 2, 2))
        J[:, 0, 0], J[:, 0, 1], J[:, 1, 0], J[:, 1, 1] = 2 * x[:, 0], 2 * x[:, 1], -1, 1
        return r, J

    return residual


def test_every_sample_of_a_batch_finds_its_own_root():
    radii = np.array([0.5, 1.0, 2.0, 10.0])
    result = newton(circle_and_line(radii), np.full((4, 2), [1.0, 0.3]))
    np.testing.assert_allclose(result.x, np.repeat(radii[:, None] / np.sqrt(2), 2, axis=1), rtol=1e-13)
    assert (result.residual <= 1e-12).all()
    assert result.iterations[1] < result.iterations[3], "a sample that is done is left alone"


def test_near_the_root_digits_double_at_every_step():
    errors = []
    for steps in range(1, 5):
        result = newton(circle_and_line(np.array([1.0])), np.array([[0.8, 0.75]]), max_iterations=steps)
        errors.append(abs(result.x[0, 0] - np.sqrt(0.5)))
    assert errors[0] < 0.01
    assert errors[1] < 5 * errors[0] ** 2
    assert errors[2] < 5 * errors[1] ** 2


def test_a_root_that_is_found_already_costs_no_step():
    result = newton(circle_and_line(np.array([1.0])), np.full((1, 2), np.sqrt(0.5)))
    assert result.iterations[0] == 0


def test_no_coordinate_moves_further_than_the_largest_step():
    seen = []

    def residual(x, samples):
        seen.append(x.copy())
        return 100.0 - x, np.tile(np.eye(2), (len(x), 1, 1))

    result = newton(residual, np.zeros((1, 2)), max_iterations=300)
    assert np.abs(np.diff(np.concatenate(seen), axis=0)).max() <= 0.5 + 1e-12
    np.testing.assert_allclose(result.x, 100.0)


def test_a_system_without_solution_ends_at_its_nearest_point():
    """A point at distance 3 from a circle of radius 1: the best is 2 away, and the foot of the normal."""

    def residual(x, samples):
        r = np.stack([3.0 - np.cos(x[:, 0]), -np.sin(x[:, 0])], axis=1)
        return r, np.stack([-np.sin(x), np.cos(x)], axis=1)

    result = newton(residual, np.array([[0.8], [-1.3]]))
    np.testing.assert_allclose(result.residual, 2.0, atol=1e-9)
    np.testing.assert_allclose(result.x, 0.0, atol=1e-4)


def test_an_exactly_singular_start_is_left_by_a_damped_step():
    """x^2 + x y = 1, y = 1/2: at the origin the first row of the Jacobian vanishes; then y turns it on."""

    def residual(x, samples):
        r = np.stack([1 - x[:, 0] ** 2 - x[:, 0] * x[:, 1], 0.5 - x[:, 1]], axis=1)
        J = np.zeros((len(x), 2, 2))
        J[:, 0, 0], J[:, 0, 1], J[:, 1, 1] = 2 * x[:, 0] + x[:, 1], x[:, 0], 1
        return r, J

    result = newton(residual, np.array([[0.0, 0.0], [0.7, 0.4]]))
    root = (np.sqrt(0.25 + 4) - 0.5) / 2
    np.testing.assert_allclose(result.x, [[root, 0.5]] * 2, atol=1e-12)
    assert result.iterations[1] <= 5, "the regular sample is not held up"


def test_an_underdetermined_system_takes_the_shortest_step():
    def residual(x, samples):
        return 1.0 - x.sum(axis=1, keepdims=True), np.ones((len(x), 1, 3))

    result = newton(residual, np.zeros((1, 3)))
    np.testing.assert_allclose(result.x, 1 / 3, atol=1e-9)


def test_an_overdetermined_consistent_system_is_solved_exactly():
    A = np.random.default_rng(0).normal(size=(6, 3))
    b = A @ [0.1, 0.2, -0.3]

    def residual(x, samples):
        return b - x @ A.T, np.tile(A, (len(x), 1, 1))

    np.testing.assert_allclose(newton(residual, np.zeros((2, 3))).x, [[0.1, 0.2, -0.3]] * 2, atol=1e-12)


def test_only_samples_still_at_work_are_evaluated():
    calls = []

    def residual(x, samples):
        calls.append(list(samples))
        wanted = np.array([0.0, 2.0])[samples, None]
        return wanted - x, np.ones((len(x), 1, 1))

    newton(residual, np.zeros((2, 1)))
    assert calls[0] == [0, 1]
    assert all(call == [1] for call in calls[1:])
    assert len(calls) == 5


def test_an_empty_batch_is_solved():
    result = newton(circle_and_line(np.empty(0)), np.empty((0, 2)))
    assert result.x.shape == (0, 2)
