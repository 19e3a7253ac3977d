# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Virtual power: from the bodies to mass matrix, inertia terms and generalised forces.

Every centre of mass is a fixed combination of the link directions, G = sum_j rho_j e^(i phi_j)
(+ constant). The sums over the bodies of document 1's power balance and document 3's virtual
work, m v . a, J w eps and P . v, then need the bodies only through two kinds of constants,

    C_jk = sum_bodies m conj(rho_j) rho_k  (+ J on the diagonal)      W_j = sum_bodies m rho_j,

made once. With A + i B = C_jk e^(i (phi_k - phi_j)), the virtual power of all inertia forces
through the spin of link j is sum_k A phi_k'' - B phi_k'^2, and the links' spins per unit of each
independent speed (the partial velocities) make M, h and Q of it. No pin reaction appears.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.links import Links, PerLink
from linkage_ros.numeric import Real


class MassBody(NamedTuple):
    """A body as dynamics sees it.

    Attributes:
        link: Index of the link that it turns with.
        mass: kg.
        inertia: About its centre of mass, kg m^2.
        center: Centre of mass as a combination of the link directions, m.
    """

    link: int
    mass: float
    inertia: float
    center: tuple[complex, complex, complex]


class MassDistribution:
    """The bodies of a mechanism, summed once into the constants of the equations of motion."""

    def __init__(self, bodies: Sequence[MassBody], gravity: tuple[float, float]) -> None:
        def moment(j: int, k: int) -> complex:
            return sum(body.mass * body.center[j].conjugate() * body.center[k] for body in bodies)

        own = (sum(body.inertia for body in bodies if body.link == j) for j in range(3))
        self._diagonal = tuple(moment(j, j).real + inertia for j, inertia in enumerate(own))
        coupling = moment(0, 1), moment(0, 2), moment(1, 2)
        self._coupling = tuple((c.real, c.imag) if c else None for c in map(complex, coupling))
        # Weight through the spin of link j: Re(conj(i W_j e^(i phi_j)) g) = y cos - x sin.
        first = (sum(body.mass * body.center[j] for body in bodies) for j in range(3))
        weight = (complex(w).conjugate() * complex(*gravity) for w in first)
        self._weight = tuple((w.real, w.imag) for w in weight)

    def equations(
        self, links: Links, rates: PerLink, bias: PerLink
    ) -> tuple[list[list[Real]], list[Real], list[Real]]:
        """M, h and Q of M q'' + h = Q + driving torque, at one position and speed.

        Args:
            links: The position.
            rates: Spin of each link, rad/s.
            bias: Angular acceleration of each link while q'' = 0, rad/s^2.

        Returns:
            Mass matrix M, kg m^2; inertia terms h at q'' = 0, N m; weights Q, N m: a row or
            an entry for each independent speed, floats or arrays as in `links`.
        """
        _, (c1, c2, c3), (s1, s2, s3), partial, _ = links
        (w1, w2, w3), (b1, b2, b3) = rates, bias
        d1, d2, d3 = self._diagonal
        (x1, y1), (x2, y2), (x3, y3) = self._weight
        c12, c13, c23 = self._coupling
        a12 = a13 = a23 = 0.0
        t1, t2, t3 = d1 * b1, d2 * b2, d3 * b3
        if c12:
            a12, g = _coupled(c12, c1, s1, c2, s2)
            t1, t2 = t1 + a12 * b2 - g * (w2 * w2), t2 + a12 * b1 + g * (w1 * w1)
        if c13:
            a13, g = _coupled(c13, c1, s1, c3, s3)
            t1, t3 = t1 + a13 * b3 - g * (w3 * w3), t3 + a13 * b1 + g * (w1 * w1)
        if c23:
            a23, g = _coupled(c23, c2, s2, c3, s3)
            t2, t3 = t2 + a23 * b3 - g * (w3 * w3), t3 + a23 * b2 + g * (w2 * w2)
        f1, f2, f3 = y1 * c1 - x1 * s1, y2 * c2 - x2 * s2, y3 * c3 - x3 * s3
        mass, inertial, force = [], [], []
        for k1, k2, k3 in partial:
            p1 = d1 * k1 + a12 * k2 + a13 * k3
            p2 = a12 * k1 + d2 * k2 + a23 * k3
            p3 = a13 * k1 + a23 * k2 + d3 * k3
            row = []
            for l1, l2, l3 in partial:
                # A comprehension would cost a single float state a tenth of its time.
                row.append(p1 * l1 + p2 * l2 + p3 * l3)
            mass.append(row)
            inertial.append(k1 * t1 + k2 * t2 + k3 * t3)
            force.append(k1 * f1 + k2 * f2 + k3 * f3)
        return mass, inertial, force


def _coupled(
    constant: tuple[float, float], cj: Real, sj: Real, ck: Real, sk: Real
) -> tuple[Real, Real]:
    """C_jk e^(i (phi_k - phi_j)) as A and B."""
    cos, sin = cj * ck + sj * sk, cj * sk - sj * ck
    real, imag = constant
    return real * cos - imag * sin, real * sin + imag * cos
