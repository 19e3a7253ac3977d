# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The errata in lab/docs/errata.md: each equation as printed and corrected, with its figures."""

import math

import numpy as np
import pytest
from pages import read

from linkage_lab.period import speed_driven_period
from linkage_ros import Body, Coupler, FourBar, Frame, Guide, Slider, SliderCrank, Solver
from linkage_ros.settings.configuration import load
from linkage_ros.units import radians_per_second

ERRATA = ' '.join(read('lab/docs/errata.md').split())
TURN = 2 * math.pi


def unit(angle):
    return np.exp(1j * angle)


def dot(u, v):
    return (np.conj(u) * v).real


def solved(u, v, w):
    """Solves x u + y v = w for real x and y; u, v, w are complex."""
    determinant = dot(1j * u, v)
    return dot(1j * w, v) / determinant, dot(1j * u, w) / determinant


# Ghalbi 2019.


R, B, C, D = 0.1, 0.315, 0.5, 0.425 * np.exp(7j / 4 * math.pi)
SPEED, CRANKS = 5 * math.pi, np.arange(0, TURN, TURN / 100)


def positions(length, *, is_real):
    """Solves for the angles of coupler and rocker by Ghalbi's Newton-Raphson.

    Args:
        length: Length in the second column of the Jacobian, m.
        is_real: Whether the first row of that column is a real part.

    Returns:
        The angles, rad, and the number of iterations.
    """
    found, count, x = [], 0, np.radians([15.0, 100.0])
    for alpha in CRANKS:
        changes = np.ones(4)
        while max(abs(changes)) > 1e-3:
            coupler, rocker = unit(x)
            f = R * unit(alpha) + B * coupler - C * rocker - D
            first, second = 1j * B * coupler, -1j * length * rocker
            top = second.real if is_real else second
            jacobian = np.array([[first.real, top], [first.imag, second.imag]])
            step = -np.linalg.solve(jacobian, [f.real, f.imag])
            changes = np.array([*step, f.real, f.imag])
            x, count = x + step, count + 1
        found.append(x)
    return np.array(found).T, count


def torque(cranks, beta, gamma, sign):
    """Eq. 13 to 18 and 1; the right-hand side of eq. 17 and 18 is as printed, times `sign`."""
    crank, coupler, rocker = R * unit(cranks), B * unit(beta), C * unit(gamma)
    beta1, gamma1 = solved(-1j * coupler, 1j * rocker, 1j * SPEED * crank)
    right = SPEED**2 * crank + beta1**2 * coupler - gamma1**2 * rocker
    beta2, gamma2 = solved(-1j * coupler, 1j * rocker, sign * right)
    v2, v3 = 1j * SPEED * crank + 0.5j * beta1 * coupler, 0.5j * gamma1 * rocker
    a2 = -(SPEED**2) * crank + (1j * beta2 - beta1**2) * coupler / 2
    a3 = (1j * gamma2 - gamma1**2) * rocker / 2
    power = 2.0 * dot(v2, a2 + 9.81j) + 0.016 * beta1 * beta2
    return (power + 3.5 * dot(v3, a3 + 9.81j) + 0.066 * gamma1 * gamma2) / SPEED


def test_right_hand_sides_of_eq_17_and_18_have_the_wrong_sign():
    cranks = np.linspace(0, TURN, 20001)
    exact = Solver(load('quadrilateral').mechanism).state(cranks, SPEED)
    _, *angles = exact.position
    assert np.abs(torque(cranks, *angles, -1) - exact.torque).max() < 1e-12
    off, peak = np.abs(torque(cranks, *angles, 1) - exact.torque).max(), np.abs(exact.torque).max()
    assert f'off by up to {off:.2f} N m, although its peak is {peak:.2f} N m' in ERRATA


def test_jacobian_of_the_listing_has_two_slips():
    exact = Solver(load('quadrilateral').mechanism).state(CRANKS, SPEED).torque

    def error(length, *, is_real):
        angles, count = positions(length, is_real=is_real)
        assert np.iscomplexobj(angles) != is_real
        return count, np.abs(torque(CRANKS, *angles.real, -1) - exact).max()

    (count, right), (slow, off) = (error(length, is_real=True) for length in (C, B))
    assert f'{slow} iterations a turn instead of {count}' in ERRATA
    assert f'{off:.4f} N m instead of {right:.1e} N m'.replace('e-06', 'e-6') in ERRATA
    assert min(error(length, is_real=False)[1] for length in (B, C)) > 1
    (beta, _), _ = positions(B, is_real=False)
    assert np.abs(beta.imag).max() > 0.005


# Mottola 2017.


def test_eq_25_and_26_divide_by_zero_where_a_link_points_back():
    """The rocker at 180 deg makes d = 0; the coupler at 180 deg makes a = 0."""
    for lengths in ((3.0, 2.5, 2.2, 1.0), (2.5, 3.0, 2.2, 1.2)):
        r2, r3, r4, r1 = lengths
        solver = Solver(FourBar(Frame(r1), Body(r2), Coupler(r3), Body(r4)))
        cranks = np.linspace(0, TURN, 200_001)
        _, theta3, theta4 = solver.state(cranks).position
        h1, h2, h3 = r1 / r2, r1 / r3, r1 / r4
        h4 = (-(r1**2) - r2**2 - r3**2 + r4**2) / (2 * r2 * r3)
        h5 = (r1**2 + r2**2 - r3**2 + r4**2) / (2 * r2 * r4)
        a = -h1 + (1 + h2) * np.cos(cranks) + h4
        d = -h1 + (1 - h3) * np.cos(cranks) + h5
        assert abs(d[np.argmax(np.abs(theta4))]) < 1e-4
        assert abs(a[np.argmax(np.abs(theta3))]) < 1e-4
        assert min(np.abs(a).max(), np.abs(d).max()) > 0.1


# Deliu and Vlase.


def pump_motion():
    q, u = (0.7, 1.6), (2.0, -0.4)
    solver = Solver(load('wind_pump').mechanism)
    return solver.mechanism, solver.state(q, u, (3.0, -1.5))


def test_velocities_close_the_loop_as_printed_and_accelerations_lack_the_squared_rates():
    pump, state = pump_motion()
    lengths = np.array([pump.crank.length, pump.coupler.length, pump.rod.length])
    phi, rates, changes = (np.array(row[:3]) for row in state[:3])
    sine, cosine = lengths * np.sin(phi), lengths * np.cos(phi)
    assert abs(rates @ sine + state.velocity[3]) < 1e-14
    assert abs(rates @ cosine) < 1e-14
    printed = np.array([changes @ sine + state.acceleration[3], changes @ cosine])
    lack = np.array([rates**2 @ cosine, -(rates**2) @ sine])
    assert np.abs(printed).min() > 0.1
    assert np.abs(printed + lack).max() < 1e-13


def test_velocity_coefficients_match_the_errata():
    pump, state = pump_motion()
    l1, l2, l3 = pump.crank.length, pump.coupler.length, pump.rod.length
    phi1, phi2, phi3, _ = state.position
    speed, _, _, slide = state.velocity
    delta = math.sin(phi2 - phi3)
    a11, a12 = l1 * math.sin(phi3 - phi1) / (l2 * delta), -math.cos(phi3) / (l2 * delta)
    a21, a22 = l1 * math.sin(phi1 - phi2) / (l3 * delta), math.cos(phi2) / (l3 * delta)
    assert a11 * speed + a12 * slide == pytest.approx(state.velocity[1], rel=1e-13)
    assert a21 * speed + a22 * slide == pytest.approx(state.velocity[2], rel=1e-13)


# Redaelli 2024.

ROD = SliderCrank(Body(1.0), Coupler(math.sqrt(2)), Slider(), Guide())


def test_eq_3_lacks_a_factor_c_and_the_angle_at_b_is_2_pi_less_beta():
    _, beta, c = Solver(ROD).state(math.pi / 4).position
    along = math.cos(math.pi / 4) + math.sqrt(2) * math.cos(beta)
    assert along == pytest.approx(c * math.cos(0.0), rel=1e-15)  # gamma is 0
    assert abs(along - math.cos(0.0)) > 0.9
    assert math.degrees(TURN - beta) % 360 == pytest.approx(30, rel=1e-14)


def test_command_of_the_page_reproduces_the_figures():
    """Checks eq. 4, 6 and 8 at every angle, with the command's speed and acceleration."""
    command = 'linkage_chart motion slider_crank --rpm 4.774648 --acceleration 1'
    assert command in ERRATA
    rpm, acceleration = (float(command.split()[i]) for i in (-3, -1))
    speed = radians_per_second(rpm)
    assert speed == pytest.approx(0.5, rel=1e-7)
    period = speed_driven_period(load('slider_crank').mechanism, speed, acceleration)
    a, b, alpha = 1.0, math.sqrt(2), period.crank
    sin, cos = np.sin(alpha), np.cos(alpha)
    beta = np.arcsin(-a * sin / b)
    along, across = b * np.cos(beta), b * np.sin(beta)
    rate = -0.5 * a * cos / along
    change = -(acceleration * a * cos - 0.25 * a * sin - rate**2 * across) / along
    figures = {
        'coupler.direction': beta,
        'slider.position': a * cos + along,
        'coupler.angular_velocity': rate,
        'slider.velocity': -0.5 * a * sin - across * rate,
        'coupler.angular_acceleration': change,
        'slider.acceleration': -acceleration * a * sin - 0.25 * a * cos - rate**2 * along
        - across * change,
    }  # fmt: skip
    for name, values in figures.items():
        assert np.abs(period.columns[name].values - values).max() < 2e-7, name
