# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Solver(compiled=True): Numba's programs against the programs for floats."""

import pickle
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from linkage_ros import (
    Body,
    ConfigurationError,
    Coupler,
    FourBar,
    MechanismError,
    SliderCrank,
    Solver,
    UnreachableError,
)
from linkage_ros.dynamics.trees import leaves
from linkage_ros.formulas import Opaque
from linkage_ros.parameters.configuration import load


def test_compiled_programs_give_what_others_give():
    mechanism = load('wind_pump').mechanism
    fast, plain = Solver(mechanism, compiled=True), Solver(mechanism)
    q, u = (np.linspace(-0.3, 0.4, 5), np.full(5, 1.6)), (np.linspace(1, 2, 5), 0.2)
    for call in (
        lambda solver: solver.state(q, u),
        lambda solver: solver.accelerations(q, u, 2.5),
        lambda solver: solver.energy(q, u),
        lambda solver: solver.point(solver.state(q, u), 'B'),
        lambda solver: (*solver.reactions(solver.state(q, u)).pins.values(),),
    ):
        for found, wanted in zip(leaves(call(fast)), leaves(call(plain)), strict=True):
            assert np.shape(found) == np.shape(wanted)
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-15 * np.abs(wanted).max())


def test_compiled_programs_refuse_what_others_refuse():
    solver = Solver(load('wind_pump').mechanism, compiled=True)
    with pytest.raises(UnreachableError, match='slider position 5 m; there the slider can be'):
        solver.state((0.0, np.array([1.5, 5.0, 1.6])), (0.0, 0.0))
    with pytest.raises(ConfigurationError, match='crank speed = nan'):
        solver.state((0.0, np.array([1.5, 1.6])), (np.nan, 0.0))


def test_mass_matrix_of_constants_alone_is_guarded_too():
    wheel = SliderCrank(Body(0.3, 1.0, 0.1), Coupler(0.9))
    assert Solver(wheel, compiled=True).accelerations(np.ones(3), 2.0, 0.5) == pytest.approx(5.0)
    massless = Solver(SliderCrank(Body(0.3), Coupler(0.9)), compiled=True)
    with pytest.raises(MechanismError, match='something moves without a mass'):
        massless.accelerations(np.ones(3), 2.0, 0.5)


def test_pickled_solver_stays_compiled(monkeypatch):
    solver = pickle.loads(pickle.dumps(Solver(load('quadrilateral').mechanism, compiled=True)))
    monkeypatch.setattr('linkage_ros.dynamics.solver.compiled_arrays', lambda *_: 'compiled')
    assert solver.state(np.zeros(2)) == 'compiled'


def test_function_that_numba_cannot_compile_runs_without_it():
    table = Opaque(lambda angle: 3.0 * angle)

    class Pull(tuple):
        def forces(self, links, rates):
            return {2: self[0](links[2].position)}

        def resistance(self, links, rates):
            return {}

    @dataclass(frozen=True)
    class Pulled(FourBar):
        def link_loads(self):
            return (Pull((table,)),)

    preset = load('quadrilateral').mechanism
    pulled = Pulled(preset.frame, preset.crank, preset.coupler, preset.rocker)
    fast, plain = (Solver(pulled, compiled=x).state(np.ones(2), 2.0).torque for x in (True, False))
    assert np.array_equal(fast, plain)
    assert not np.array_equal(fast, Solver(preset).state(np.ones(2), 2.0).torque)


def test_missing_numba_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, 'numba', None)
    solver = Solver(load('coupler_point').mechanism, compiled=True)
    assert solver.state(0.5, 1.0).position[0] == 0.5  # floats do without
    with pytest.raises(ConfigurationError, match=r'compiled=True needs numba.*pip install numba'):
        solver.matrix(np.zeros(2))
