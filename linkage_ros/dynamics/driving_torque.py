# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Virtual power: from the bodies to mass matrix, inertia terms and generalised forces.

Every centre of mass is a fixed combination of the link directions, G = sum_j rho_j e^(i phi_j)
(+ constant). The sums over the bodies of document 1's power balance and document 3's virtual
work, m v . a, J w eps and P . v, then need the bodies only through two kinds of constants,

    C_jk = sum_bodies m conj(rho_j) rho_k  (+ J on the diagonal)      W_j = sum_bodies m rho_j,

made once. With A + i B = C_jk e^(i (phi_k - phi_j)), the virtual power of all inertia forces
through the spin of link j is sum_k A phi_k'' - B phi_k'^2. Weighed with the links' spins per rate
of each coordinate (the partial velocities), this and the weights' power make the equations
of motion M q'' + h = Q + driving torque. No pin reaction appears. A link that slides adds its
mass, its weight's share along the guide, the external force and the guide's resistance. A free
slider, whose place is the last coordinate, is coupled with no link: it adds them to that alone.

The sums over the three links are written out: as loops they would make a state a seventh slower.
"""

from __future__ import annotations

from linkage_ros.mechanisms.links import Links, PerLink
from linkage_ros.mechanisms.structure import Structure
from linkage_ros.numeric import Real


class MassDistribution:
    """The bodies of a mechanism, summed once into the constants of the equations of motion."""

    def __init__(self, structure: Structure, gravity: tuple[float, float]) -> None:
        bodies = structure.bodies

        def moment(j: int, k: int) -> complex:
            return sum(
                body.mass * body.center.weights[j].conjugate() * body.center.weights[k]
                for body in bodies
            )

        own = (sum(body.inertia for body in bodies if body.link == j) for j in range(3))
        diagonal = [moment(j, j).real + inertia for j, inertia in enumerate(own)]
        coupling = moment(0, 1), moment(0, 2), moment(1, 2)
        self._coupling = tuple((c.real, c.imag) if c else None for c in map(complex, coupling))
        # Weight through the spin of link j: Re(conj(i W_j e^(i phi_j)) g) = y cos - x sin.
        first = (sum(body.mass * body.center.weights[j] for body in bodies) for j in range(3))
        weight = [complex(w).conjugate() * complex(*gravity) for w in first]
        slider = structure.slider
        self._output = None if structure.free_slider else slider
        self._resistance: tuple[float, float] | None = None
        if self._output:
            # Link 2 slides: its "inertia" is its mass, and g . e^(i guide) the weight's share.
            diagonal[2] = self._output.mass
            weight[2] = self._output.mass * complex(-gravity[1], gravity[0])
            if self._output.damping or self._output.force:
                self._resistance = self._output.damping, self._output.force
        # A free slider, along x, and the share of its weight there.
        self._free = structure.free_slider
        self._free_weight = slider.mass * gravity[0] if slider else 0.0
        self._diagonal = tuple(diagonal)
        self._weight = tuple((w.real, w.imag) if w else None for w in weight)

    def balance(
        self,
        links: Links,
        rates: PerLink,
        accelerations: PerLink,
        slide: tuple[Real, Real] | None = None,
    ) -> tuple[Real, ...]:
        """M q'' + h - Q: what has to act on each coordinate besides the weights.

        It is linear in the accelerations. With those of the whole motion it is the driving
        torque; with those that remain at q'' = 0 it is h - Q; at rest it is -Q, the weights.

        Args:
            links: The position.
            rates: Velocity of each of the three links, rad/s or m/s.
            accelerations: Acceleration of each, rad/s^2 or m/s^2.
            slide: Velocity and acceleration of a free slider.

        Returns:
            For each coordinate, N m where it is an angle, else N; floats or arrays, as in `links`.
        """
        _, (c1, c2, c3), (s1, s2, s3), partial, _ = links
        (w1, w2, w3), (e1, e2, e3) = rates, accelerations
        d1, d2, d3 = self._diagonal
        weight1, weight2, weight3 = self._weight
        c12, c13, c23 = self._coupling
        t1, t2, t3 = d1 * e1, d2 * e2, d3 * e3
        if weight1:
            x, y = weight1
            t1 = t1 - (y * c1 - x * s1 if x else y * c1)
        if weight2:
            x, y = weight2
            t2 = t2 - (y * c2 - x * s2 if x else y * c2)
        if weight3:
            x, y = weight3
            t3 = t3 - (y * c3 - x * s3 if x else y * c3)
        if self._resistance:
            damping, force = self._resistance
            t3 = t3 + (damping * w3 - force)
        if c12:
            a, b = _coupled(c12, c1, s1, c2, s2)
            t1, t2 = t1 + a * e2 - b * (w2 * w2), t2 + a * e1 + b * (w1 * w1)
        if c13:
            a, b = _coupled(c13, c1, s1, c3, s3)
            t1, t3 = t1 + a * e3 - b * (w3 * w3), t3 + a * e1 + b * (w1 * w1)
        if c23:
            a, b = _coupled(c23, c2, s2, c3, s3)
            t2, t3 = t2 + a * e3 - b * (w3 * w3), t3 + a * e2 + b * (w2 * w2)
        powers = [k1 * t1 + k2 * t2 + k3 * t3 for k1, k2, k3 in partial]
        if slide and self._free:
            velocity, acceleration = slide
            push = self._free_weight - self._free.damping * velocity
            powers[-1] = powers[-1] + (self._free.mass * acceleration - push)
        return tuple(powers)

    def potential(self, links: Links) -> Real:
        """The potential energy of the weights; an external force on a slider is not among them.

        Args:
            links: The position.

        Returns:
            J, from the height of the origin, but for a constant; floats or arrays.
        """
        position, cosines, sines, _, _ = links
        energy = 0.0
        for j, weight in enumerate(self._weight):
            if weight:
                x, y = weight
                if j == 2 and self._output:
                    energy = energy - (y * cosines[j] - x * sines[j]) * position[j]
                else:
                    energy = energy - (x * cosines[j] + y * sines[j])
        if self._free:
            energy = energy - self._free_weight * position[3]
        return energy

    def matrix(self, links: Links) -> tuple[tuple[Real, ...], ...]:
        """The mass matrix M.

        Args:
            links: The position.

        Returns:
            A row for each coordinate, kg m^2 between angles, kg between slides; floats or
            arrays, as in `links`.
        """
        _, (c1, c2, c3), (s1, s2, s3), partial, _ = links
        d1, d2, d3 = self._diagonal
        c12, c13, c23 = self._coupling
        a12 = _coupled(c12, c1, s1, c2, s2)[0] if c12 else 0.0
        a13 = _coupled(c13, c1, s1, c3, s3)[0] if c13 else 0.0
        a23 = _coupled(c23, c2, s2, c3, s3)[0] if c23 else 0.0
        momenta = [
            (
                d1 * k1 + a12 * k2 + a13 * k3,
                a12 * k1 + d2 * k2 + a23 * k3,
                a13 * k1 + a23 * k2 + d3 * k3,
            )
            for k1, k2, k3 in partial
        ]
        rows = [[k1 * p1 + k2 * p2 + k3 * p3 for p1, p2, p3 in momenta] for k1, k2, k3 in partial]
        if self._free:
            rows[-1][-1] = rows[-1][-1] + self._free.mass
        return tuple(map(tuple, rows))


def _coupled(
    constant: tuple[float, float], cj: Real, sj: Real, ck: Real, sk: Real
) -> tuple[Real, Real]:
    """C_jk e^(i (phi_k - phi_j)) as A and B."""
    cos, sin = cj * ck + sj * sk, cj * sk - sj * ck
    real, imag = constant
    if not imag:  # centres of mass lie on the lines between the pins
        return real * cos, real * sin
    return real * cos - imag * sin, real * sin + imag * cos
