# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Objects print what they are, in a console or a notebook."""

import numpy as np
import pytest
from mechanisms import ALL, moving

from linkage_ros import Drawing, DrawnLink, Solver, load, preset_names


@pytest.mark.parametrize('preset', preset_names())
def test_configuration_prints_on_one_line_with_its_links(preset):
    found, solver = load(preset), Solver(load(preset))
    for one in (found, found.mechanism, solver):
        line = repr(one)
        assert '\n' not in line
        assert len(line) < 200
        assert type(found.mechanism).__name__ in line
        assert all(link in line for link in solver.links)


def test_drawing_prints_on_one_line_with_its_parts():
    pins = {'O': (0, 0), 'A': (30, 40), 'B': (120, 90), 'Q': (140, 0)}
    links = {'arm': ('O', 'A'), 'rod': ('A', 'B'), 'lever': ('Q', 'B')}
    line = repr(
        Drawing(
            input='arm', frame=['O', 'Q'], pins=pins,
            links=[DrawnLink(*link) for link in links.items()],
        )
    )  # fmt: skip
    assert '\n' not in line
    assert all(word in line for word in ('Drawing', *links))


@pytest.mark.parametrize('name', ['crank_rocker', 'document_4', 'pump', 'swinging_barrel_driven'])
@pytest.mark.parametrize('cranks', [0.7, np.linspace(0.6, 0.8, 3)], ids=['float', 'array'])
def test_state_prints_a_row_for_each_link(name, cranks):
    solver = Solver(ALL[name])
    rows = [line.split()[0] for line in repr(moving(solver, cranks)).splitlines()]
    assert rows[2:] == [*solver.links, 'torque']
