# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dyads of mechanisms: states and forces in many digits, order, reach, refusals."""

import cmath
import itertools
import math
import random
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import (
    FULL,
    LIMITED,
    MOVING_GUIDES,
    PUMPS,
    cylinder,
    four_bar,
    is_free,
    motion,
    slider_crank,
    with_loads,
)
from mpmath import mp
from oracle import Oracle, wrap
from ros_harness import verified

from linkage_ros import (
    Barrel,
    Body,
    ConfigurationError,
    Coupler,
    Dyad,
    DyadSlider,
    Force,
    FourBar,
    Frame,
    Friction,
    Gas,
    LinkageError,
    LinkLoad,
    LoadCurve,
    MechanismError,
    MotionError,
    Pins,
    Rod,
    Solver,
    Spring,
    UnreachableError,
    read_log,
    travel,
)
from linkage_ros.mechanism.axes import axes_of
from linkage_ros.programs.record import record
from linkage_ros.quantities import flatten
from linkage_ros.settings.configuration import configure, from_strings, load, to_strings
from linkage_ros.settings.notes import notes

EPSILON = 2.0**-52
TURN = math.tau
STRUCTURES = 60  # 300 were run by hand


def pose(mechanism, q):
    """Returns the direction of each link, and its first pin or a slider's pin, by name."""
    solver = Solver(mechanism)
    state, structure = solver.state(q), solver.structure
    turned = [cmath.rect(1.0, x) for x in state.position]
    found = {'frame': (1.0, 0j)}
    for i, link in enumerate(structure.links):
        point = structure.point_of(i, (0.0, 0.0))
        place = point.fixed + sum(w * x for w, x in zip(point.weights, turned, strict=True))
        spin, guide = axes_of(structure.links, i)
        found[link.name] = (
            (1.0 if spin is None else turned[spin]) * cmath.rect(1.0, guide or 0.0),
            place,
        )
    return found


def random_body(rng, length):
    return Body(
        length, rng.uniform(0.1, 3), rng.uniform(0.01, 0.5),
        (rng.uniform(-0.3, 1) * length, rng.uniform(-0.5, 0.5) * length),
    )  # fmt: skip


def pair(rng):
    return rng.uniform(-1, 1), rng.uniform(-1, 1)


def random_dyad(rng, name, known, sine):
    """Makes a dyad that closes with a sine where the links are; `known` as from `pose`."""

    def end(*others):
        link = rng.choice([x for x in known if x not in others])
        at = rng.uniform(-1.5, 1.5), rng.uniform(-1.5, 1.5)
        direction, place = known[link]
        return link, at, place + complex(*at) * direction

    assembly = rng.choice(['open', 'crossed'])
    link, at, start = end()
    kind = rng.choice(['links', 'links', 'slider', 'slider', 'barrel'])
    height = rng.choice([1, -1]) * math.sqrt(1 - sine * sine)
    if kind == 'slider':
        length, angle = rng.uniform(0.5, 2.5), rng.uniform(-3, 3)
        guide = start + cmath.rect(1.0, angle) * complex(rng.uniform(-1, 1), length * height)
        carrier, *_ = end(link)
        direction, place = known[carrier]
        on, angle = (guide - place) / direction, angle - cmath.phase(direction)
        slider = DyadSlider(rng.uniform(0.1, 3), (on.real, on.imag), angle, carrier)
        if carrier != 'frame':
            slider = replace(slider, inertia=rng.uniform(0.01, 0.5), center=pair(rng))
        first = random_body(rng, length)
        return Dyad(
            name=name, from_=link, from_at=at, first=first, slider=slider, assembly=assembly
        )
    other, other_at, stop = end(link)
    while abs(stop - start) < 0.3:
        other, other_at, stop = end(link)
    if kind == 'barrel':
        return Dyad(
            name=name, from_=link, from_at=at, to=other, to_at=other_at,
            barrel=Barrel(rng.uniform(0.1, 3), rng.uniform(0.01, 0.5), pair(rng)),
            rod=Rod(rng.uniform(0.1, 3), rng.uniform(0.01, 0.5), pair(rng)),
            offset=height * abs(stop - start),
        )  # fmt: skip
    # The triangle with the angle between the links, from the distance of the ends.
    turn = math.asin(sine) if rng.random() < 0.5 else math.pi - math.asin(sine)
    distance, first, ratio = abs(stop - start), 0.0, 1.0
    while not 0.1 < first / distance < 5:
        ratio = rng.uniform(0.5, 2)
        first = distance / abs(1 - ratio * cmath.rect(1.0, turn))
    return Dyad(
        name=name, from_=link, from_at=at, to=other, to_at=other_at, assembly=assembly,
        first=random_body(rng, first), second=random_body(rng, first * ratio),
    )  # fmt: skip


def random_structure(rng, nearest=0.0, most=3):
    """Makes a mechanism with dyads, three at most by default, and loads, and its coordinates."""
    kinds = ['crank_rocker', 'double_crank', 'centric', 'offset_right', 'cylinder', 'pump']
    kind, crank = rng.choice(kinds), rng.uniform(-3, 3)
    if kind == 'pump':
        base = rng.choice([PUMPS['pump'], PUMPS['pump_open']])
    elif kind == 'cylinder':
        base = cylinder((1, 2.5, 0.7), rng.uniform(-3, 3))
        if rng.random() < 0.5:
            base = replace(base, input='cylinder', assembly=rng.choice(['open', 'crossed']))
    else:
        make = four_bar if len(FULL[kind]) == 4 else slider_crank
        base = make(FULL[kind], rng.uniform(-3, 3), rng.choice(['open', 'crossed']))
    (q, u, a), size = motion(base, crank), rng.randint(1, most)
    names = rng.sample(['ram', 'shoe', 'arm', 'press', 'ejector'], size)
    for name in names:
        sine = 10 ** rng.uniform(-5, -0.53) if rng.random() < nearest else rng.uniform(0.31, 0.99)
        dyad = random_dyad(rng, name, pose(base, q), sine)
        base = replace(base, dyads=(*base.dyads, dyad))
    links = [*pose(base, q)][1:]
    one, other = rng.sample([*links, 'frame'], 2)
    one, other = (one, other) if one != 'frame' else (other, one)
    loads = (
        Force(
            rng.choice(links), pair(rng), (40.0, -70.0), rng.choice(['world', 'link']), name='push'
        ),
        Spring(one, pair(rng), other, pair(rng), 80.0, 0.3, 4.0, name='spring'),
        Pins(0.3, name='pins'),
        Pins(0.2, f'{names[0]}_from', name='stiff'),
    )
    sliders = [x.name for x in base.structure().links if x.slides]
    if sliders:
        load = LinkLoad(rng.choice(sliders), 30.0, 4.0, 50.0, 0.2, name='guided')
        loads = (*loads, load) if is_loaded(base, load) else loads
    if kind != 'pump' and not nearest and rng.random() < 0.3:
        wear = Friction(pin=0.1, pin_radius=0.02, guide=0.05 if sliders else 0.0)
        loads = (*loads, replace(wear, name='wear'))
    return with_loads(base, *loads), q, u, a


def is_loaded(mechanism, load):
    """Returns whether a mechanism has the link of a load, where it may be loaded."""
    with suppress(ConfigurationError):
        return bool(Solver(with_loads(mechanism, load)))
    return False


def compared(mechanism, q, u, a):
    """Returns errors of motion and of forces, relative to the largest, and the least sines."""
    solver, oracle = Solver(mechanism), Oracle(mechanism)
    given, torque = a, 5.0
    if oracle.is_free:
        given = solver.accelerations(q, u, torque)
    state = solver.state(q, u, given)
    forces, right = solver.reactions(state), oracle.solve(q, u, torque if oracle.is_free else a[0])
    errors, slides = [], {link.name: link.slides for link in solver.structure.links}
    for i, (row, found) in enumerate(zip(right[:3], state[:3], strict=True)):
        row = dict(zip(oracle.parts, row, strict=True))
        gaps = {name: row[name] - mp.mpf(x) for name, x in zip(slides, found, strict=True)}
        size = max(1, *map(abs, row.values()))
        errors += [abs(x if i or slides[name] else wrap(x)) / size for name, x in gaps.items()]
    peak = max(map(abs, right.pins.values()))
    reach = peak * max(1, *(abs(body.place) for body in right.bodies.values()))
    wrong = [abs(mp.mpc(*force) - right.pins[pin]) / peak for pin, force in forces.pins.items()]
    for name, (force, moment) in forces.guides.items():
        across, turning = right.guides[name]
        wrong += [abs(force - across) / peak, abs(moment - turning) / reach]
    wrong += [abs(y - right.torque) / reach for y in (state.torque, forces.torque)]
    sines = [met.sine for met in solver.dyad_sines((*q, *u))[: len(solver.structure.dyads)]]
    return float(max(errors)), float(max(wrong)), sines


@pytest.mark.parametrize('seed', range(STRUCTURES))
def test_states_and_forces_of_random_structures_are_right(seed):
    rng = random.Random(seed)
    with mp.workdps(30):
        mechanism, q, u, a = random_structure(rng, 0.0 if seed % 4 else 0.5)
        error, force_error, sines = compared(mechanism, q, u, a)
    room = 100 * EPSILON * math.prod(sine**-2 for sine in sines if sine < 0.3)
    assert error < max(1e-12, room)
    if is_free(mechanism):  # its accelerations follow from forces, and forces from them
        room *= 10
    assert force_error < max(1e-11, room)


def carrying(*dyads, **rest):
    """Makes a four-bar with dyads."""
    return replace(four_bar(FULL['crank_rocker'], gravity=(0.3, -9.81)), dyads=dyads, **rest)


def arm(name='ram', first=3.2, second=2.6, from_='coupler', to='frame', at=(4.0, 3.0), **rest):
    return Dyad(
        name=name, from_=from_, from_at=(1.5, 0.4), to=to, to_at=at,
        first=Body(first, 1.0, 0.2, (1.0, 0.1)), second=Body(second, 0.7, 0.1, (0.5, 0.0)), **rest,
    )  # fmt: skip


def press(name='press', length=3.0, from_='ram_second', at=(4.0, 5.5), angle=0.2, **rest):
    slider = DyadSlider(2.0, at, angle)
    return Dyad(name=name, from_=from_, first=Body(length, 0.5), slider=slider, **rest)


# ---------------------------------------------------------------- a mechanism with dyads


def test_order_follows_references_then_names():
    given = press('a', from_='b_second'), arm('b'), arm('d'), arm('c')
    links = Solver(carrying(*given)).links
    assert links[3::2] == ('b_first', 'a_first', 'c_first', 'd_first')
    assert Solver(carrying(*given[::-1])).links == links


def test_dyads_on_any_link_leave_the_loop_as_it_is():
    """Positions, rates and accelerations of the loop have the same bits."""
    alone, both = Solver(carrying()), Solver(carrying(arm(), press()))
    for angle in np.linspace(-3, 3, 7).tolist():
        found, right = both.state(angle, 2.0, 1.5), alone.state(angle, 2.0, 1.5)
        assert [row[:3] for row in found[:3]] == [*right[:3]]
        assert both.structure.loop_residual(found) < 1e-14
    program = Solver(carrying()).source
    assert program == alone.source


# ---------------------------------------------------------------- moving guides


def on_links(mechanism, kind, one, other):
    """Adds a dyad of a kind between points of two links, with a guide or a barrel on the other."""
    rest = {'name': 'last', 'from_': one, 'from_at': (-0.4, 0.5)}
    if kind == 'barrel':
        rest |= {
            'to': other, 'to_at': (2.0, -2.8), 'offset': 0.4,
            'barrel': Barrel(0.9, 0.3, (0.5, -0.2)), 'rod': Rod(0.7, 0.2, (-0.4, 0.3)),
        }  # fmt: skip
    else:
        slider = DyadSlider(1.2, (0.6, 0.3), -0.5, other)
        if other != 'frame':
            slider = replace(slider, inertia=0.3, center=(0.2, -0.3))
        rest |= {'first': Body(9.0, 0.8, 0.2, (2.0, 0.1)), 'slider': slider}
    return replace(mechanism, dyads=(*mechanism.dyads, Dyad(**rest)))


@pytest.mark.parametrize('kind', ['slider', 'barrel'])
@pytest.mark.parametrize('base', ['guide_on_coupler', 'barrel_between_slider_and_coupler'])
def test_dyads_between_any_two_links_are_right_with_friction_and_loads(base, kind):
    """Slider and rod push the links on which they slide, and friction pushes both."""
    base, (q, u, a) = MOVING_GUIDES[base], ((1.1,), (2.0,), (1.5,))
    links = ['frame', *(link.name for link in base.structure().links)]
    for one, other in itertools.permutations(links, 2):
        mechanism = on_links(base, kind, one, other)
        last = f'last_{"rod" if kind == "barrel" else "slider"}'
        mechanism = with_loads(
            mechanism,
            LinkLoad(last, 30.0, 4.0, 50.0, 0.2, name='a'),
            LoadCurve(last, 'position', (-1.0, 2.0, 9.0), (5.0, -7.0, 30.0), name='b'),
            Force(last, (0.3, -0.2), (20.0, -40.0), axes='link', name='c'),
            Friction(pin=0.1, pin_radius=0.02, guide=0.05),
        )
        with mp.workdps(30):
            error, force_error, _ = compared(mechanism, q, u, a)
        assert max(error, force_error) < 1e-12, (one, other)


BRACES = {
    'slider': {'first': Body(2.0, 3.0, 0.5, (0.7, 0.1)),
               'slider': DyadSlider(2.0, (1.0, 1.5), 0.3, 'coupler', 0.4, (0.1, 0.0))},
    'two links': {'first': Body(2.0, 3.0, 0.5, (0.7, 0.1)), 'to': 'coupler', 'to_at': (2.0, 1.0),
                  'second': Body(1.5, 2.0, 0.2, (0.5, 0.0))},
    'barrel': {'barrel': Barrel(1.0, 0.1, (0.2, 0.0)), 'rod': Rod(1.0, 0.1, (-0.2, 0.0)),
               'to': 'coupler', 'to_at': (2.0, 1.0)},
}  # fmt: skip


@pytest.mark.parametrize('kind', BRACES)
@pytest.mark.parametrize('q', [0.3, 0.7, 1.1, 2.0])
def test_joints_of_rigid_links_have_no_friction(kind, q):
    """At some of these angles, rounding errors give their relative rotation a sign."""
    brace = Dyad(name='brace', from_='coupler', from_at=(0.5, 0.3), **BRACES[kind])
    mechanism = carrying(brace)
    wear = Friction(pin=0.1, pin_radius=0.05, guide=0.0 if kind == 'two links' else 0.2)
    plain, worn = (Solver(with_loads(mechanism, *loads)) for loads in ((), (wear,)))
    before, after = (x.reactions(x.state(q, 2.0, 0.0)) for x in (plain, worn))
    inner = [name for name in before.pins if name.startswith('brace')]
    assert inner
    for name in inner:  # these depend on the motion of the coupler alone
        assert after.pins[name] == pytest.approx(before.pins[name], rel=1e-12)
    assert after.guides == before.guides
    assert after.torque != pytest.approx(before.torque, rel=1e-3)  # other pins rub
    given = {'mechanism': 'four_bar', 'rpm': 60.0, **flatten(mechanism)}
    (line,) = (line for line in notes(configure(given)) if 'rigid with' in line)
    assert line.startswith('brace_')
    assert 'rigid with coupler' in line


def test_a_barrel_and_a_rod_on_crank_and_frame_are_an_inverted_slider_crank():
    right = cylinder((1, 2.5, 0.7), 0.0, loads=())
    idle = FourBar(Frame(2.2), right.crank, Coupler(3.0), Body(2.5), gravity=right.gravity)
    dyad = Dyad(
        name='ram', from_='crank', from_at=(1.0, 0.0), to='frame', to_at=(2.5, 0.0),
        barrel=right.barrel, rod=right.rod, offset=right.offset,
    )  # fmt: skip
    crank, found = np.linspace(0.1, 6, 9), []
    for base, rod in ((right, 'rod'), (replace(idle, dyads=(dyad,)), 'ram_rod')):
        loads = (
            Gas(rod, 0.2, 0.1, 2e5, name='gas'),
            LoadCurve(rod, 'crank_angle_from_tdc', (0.5, 2.0, 6.0), (4.0, -3.0, 8.0), name='cut'),
            Friction(guide=0.1, name='wear'),
        )
        solver = Solver(with_loads(base, *loads))
        state = solver.state(crank, 3.0, 1.0)
        forces = solver.reactions(state)
        found.append([*state[rod], state.torque, *forces.guides[rod], forces.shaking_moment])
    for one, other in zip(*found, strict=True):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-9 * np.abs(other).max())


# ---------------------------------------------------------------- reach


@pytest.mark.parametrize('kind', ['links', 'slider', 'barrel'])
def test_reach_ends_where_the_dyad_no_longer_closes(kind):
    if kind == 'links':
        dyad, words = arm(first=1.6, second=1.5), 'too far apart'
    elif kind == 'slider':
        slider = DyadSlider(1.0, (0.6, 0.3), 0.7, 'rocker')
        dyad = Dyad(name='ram', from_='crank', from_at=(0.9, 0.0), first=Body(1.6), slider=slider)
        words = 'too far from the path'
    else:
        dyad = Dyad(
            name='ram', from_='crank', from_at=(0.9, 0.0), to='coupler', to_at=(1.5, 0.3),
            barrel=Barrel(), rod=Rod(), offset=-1.5,
        )  # fmt: skip
        words = 'too near'
    solver = Solver(carrying(dyad))
    reach = solver.reach
    assert not reach.turns_fully
    assert 'dyad ram ' in reach.limits[0]
    assert words in reach.limits[0]
    for start, end in reach.arcs:
        for inside, outside in ((start + 1e-7, start - 1e-7), (end - 1e-7, end + 1e-7)):
            assert solver.alignment((inside,))[0] < 1e-3
            with pytest.raises(UnreachableError, match='dyad ram '):
                solver.state(outside)
    with pytest.raises(MechanismError, match='cannot turn fully'):
        travel(solver)


def test_dyad_that_touches_its_limit_cannot_turn():
    """The pin of the crank is 4 m from the path at its lowest point."""

    def short(length):
        dyad = press(length=length, from_='crank', from_at=(1.0, 0.0), at=(0.0, 3.0), angle=0.0)
        return Solver(carrying(dyad)).reach

    assert short(4.000001).turns_fully
    assert 'at right angles' in short(4.0).limits[0]
    assert '0.1 m too far' in short(3.9).limits[0]


HALF_GAP = 4e-3  # rad


def tight(kind, turn):
    """Makes a four-bar, turned as a whole, with a dyad that has a gap about the angle `turn`."""
    depth = 0.5 * HALF_GAP**2  # relative to the product of two lengths
    way, across = cmath.rect(1.0, turn), cmath.rect(1.0, turn - math.pi / 2)
    rest = {'name': 'ram', 'from_': 'crank', 'from_at': (1.0, 0.0)}
    if kind == 'slider':  # 2 m from the pivot; the pin of the crank is 3 m from its path at most
        slider = DyadSlider(1.0, ((-2 * way).real, (-2 * way).imag), cmath.phase(across))
        dyad = Dyad(first=Body(3.0 - depth), slider=slider, **rest)
    else:  # the ends are 3 m apart at least, and the links reach no nearer than 3 m and the depth
        at = 4 * way
        links = {'first': Body(5.0), 'second': Body(2.0 - 4 / 3 * depth)}
        dyad = Dyad(to='frame', to_at=(at.real, at.imag), **links, **rest)
    return replace(four_bar(FULL['crank_rocker'], 0.3 + turn), dyads=(dyad,))


@pytest.mark.parametrize('kind', ['links', 'slider'])
def test_gap_turns_with_the_machine(kind):
    """Also next to crank angle 0, where the samples of a period meet."""
    near = np.linspace(-0.02, 0.02, 120)
    for turn in [*near, *(near[::5] + TURN), *np.linspace(0.0, TURN, 40)]:
        reach = Solver(tight(kind, float(turn))).reach
        assert len(reach.limits) == 1, turn
        ((start, end),) = reach.arcs
        for edge, half in ((start, HALF_GAP), (end, -HALF_GAP)):
            assert abs(math.remainder(edge - turn - half, TURN)) < 1e-5


def test_gap_between_samples_at_both_of_which_the_margin_rises():
    """Two dyads are almost in line at angles 0.1 deg apart, and carry a third, which has a gap."""

    def almost_in_line(name, turn, near, far, side):
        at = -far * cmath.rect(1.0, turn)
        slider = DyadSlider(1.0, (at.real, at.imag), turn - math.pi / 2)
        first = Body((near + far) * (1 + 1e-7))
        return Dyad(
            name=name, from_='crank', from_at=(near, 0.0), first=first, slider=slider,
            assembly=side,
        )  # fmt: skip

    half = Body(0.5 * 3.625244)
    dyads = (
        almost_in_line('a', 1.002, 1.8, 2.6, 'open'),
        almost_in_line('b', 1.0, 1.1, 1.0, 'crossed'),
        Dyad(
            name='ram', from_='a_first', from_at=(-1.2, 0.1), first=half,
            to='b_slider', to_at=(1.8, 0.8), second=half,
        ),
    )  # fmt: skip
    solver = Solver(replace(four_bar(FULL['crank_rocker']), dyads=dyads))
    with pytest.raises(UnreachableError, match='gap 3'):
        solver.state(0.999944)
    ((start, end),) = solver.reach.arcs
    assert end - TURN < 0.999944 < start


@pytest.mark.parametrize(
    ('dyads', 'words'),
    [
        ([arm(first=0.2, second=0.3)], 'does not close anywhere .* too far apart'),
        ([arm(first=9.0, second=0.3)], 'does not close anywhere .* too near'),
        ([press(from_='crank', length=0.5)], 'does not close anywhere .* from the path'),
    ],
)
def test_dyad_that_closes_nowhere_is_refused(dyads, words):
    with pytest.raises(MechanismError, match=words):
        _ = Solver(carrying(*dyads)).mobility


RAM = {'name': 'ram', 'from_': 'coupler', 'first': Body(3.0)}
MISTAKES = [
    (lambda: carrying(arm(from_='cupler', to='rocker_')),
     r"2 mistakes:\n\(1\) .*ram.from = 'cupler': must .*\n\(2\) .*ram.to = 'rocker_'"),
    (lambda: carrying(arm(from_='press_first'), press()), 'press is carried by ram is carried by'),
    (lambda: carrying(arm(from_='ram_second')), 'ram is carried by ram'),
    (lambda: carrying(arm(), arm()), "two dyads have the name 'ram'"),
    (lambda: Dyad(**RAM), 'second or slider'),
    (lambda: Dyad(**RAM, second=Body(1.0)), r'ram\.to is missing'),
    (lambda: press(to='frame'), r'press\.to is for a dyad of two links'),
    (lambda: arm('2nd'), 'its name must be letters'),
    *((lambda values=values: carrying(Dyad(**RAM | values)), words) for values, words in [
        ({'slider': DyadSlider(on='rokker')}, r"slider\.on = 'rokker': must be one of crank, "),
        ({'slider': DyadSlider(inertia=1.0)}, 'its centre of mass is its pin'),
        ({'slider': DyadSlider(center=(0.1, 0.0))}, 'its centre of mass is its pin'),
        ({'slider': DyadSlider(on='ram_slider')}, 'ram is carried by ram'),
        ({'slider': DyadSlider(), 'offset': 0.1}, 'offset is for a barrel and a rod'),
        ({'slider': DyadSlider(), 'rod': Rod()}, r'barrel and rod\)'),
        ({'first': None, 'barrel': Barrel()}, r'barrel and rod\)'),
        ({'first': None, 'barrel': Barrel(), 'rod': Rod()}, r'ram\.to is missing'),
        ({'first': None, 'barrel': Barrel(), 'rod': Rod(), 'to': 'frame', 'assembly': 'crossed'},
         'must be open with a barrel'),
    ]),
]  # fmt: skip


@pytest.mark.parametrize(('make', 'words'), MISTAKES)
def test_mistakes_are_said(make, words):
    with pytest.raises(ConfigurationError, match=words):
        make()


# ---------------------------------------------------------------- in the programs

SIX_BAR = """
/**:
  ros__parameters:
    mechanism: four_bar
    frame: {length: 2.2}
    crank: {length: 1.0, mass: 1.0, inertia: 5.0}
    coupler: {length: 3.0, mass: 1.0, inertia: 0.5}
    rocker: {length: 2.5, mass: 1.0, inertia: 0.5}
    dyads:
      shoe: {from: ram_second, from_at: [2.0, 0.1], first: {length: 3.0},
             slider: {mass: 2.0, at: [4.0, 5.5], angle: 0.2}}
      ram: {from: coupler, from_at: [1.5, 0.4], to: frame, to_at: [4.0, 3.0],
            first: {length: 3.2, mass: 1.0, inertia: 0.2}, second: {length: 2.6, mass: 0.7}}
    loads:
      push: {kind: force, link: shoe_slider, at: [0.1, 0.2], force: [-30.0, 5.0]}
      pull: {kind: spring, link: ram_first, at: [1.0, 0.0], to: shoe_slider, stiffness: 20.0}
      gas: {kind: gas, link: shoe_slider, bore: 0.1, clearance: 0.5, inlet: 1.0e5}
      bearings: {kind: pins, damping: 0.02, pin: ram_joint}
      cut: {kind: curve, link: shoe_slider, at: [0.0, 2.0], value: [0.0, 40.0]}
    joints:
      ram_second: {name: elbow, zero: 0.4, ratio: -2.0, parent: rocker}
      shoe_slider: {name: carriage, zero: 0.1}
"""
DRIVES = {
    'speed': ['rpm: 30.0'],
    'friction': [
        'rpm: 30.0',
        'loads: {wear: {kind: friction, pin: 0.1, pin_radius: 0.02, guide: 0.1}}',
    ],
    'torque': ['drive: torque', 'motor: {torque: 60.0, damping: 4.0}', 'start_rpm: 30.0'],
    'motion': ['drive: motion', 'motion: {center: 1.0, amplitude: 0.7, frequency: 0.5}'],
}


def six_bar(tmp_path, *lines):
    path = tmp_path / 'six_bar.yaml'
    path.write_text(SIX_BAR + ''.join(f'    {line}\n' for line in lines))
    return load(str(path))


@pytest.mark.parametrize('drive', DRIVES)
def test_log_of_each_drive_verifies(tmp_path, drive):
    configuration = six_bar(tmp_path, *DRIVES[drive])
    assert from_strings(to_strings(configuration)) == configuration
    names = [joint.name for joint in configuration.only.robot_joints]
    assert names[3:] == ['ram_first', 'elbow', 'shoe_first', 'carriage']
    record(configuration, tmp_path / 'run.mcap', duration=1.0)
    verified(tmp_path / 'run.mcap')


def test_six_bar_that_jams_ends_its_motion_with_the_place(tmp_path):
    """Within its arc it moves by a law; beyond, a law and a constant speed are refused."""
    short = {'length: 3.2': 'length: 1.8', 'length: 2.6': 'length: 1.7'}
    text = '\n'.join(x for x in SIX_BAR.split('\n') if 'gas:' not in x and 'cut:' not in x)
    for old, new in short.items():
        text = text.replace(old, new)
    path, start = tmp_path / 'jams.yaml', 'crank_angle: 0.3'
    law = 'motion: {{center: 0.3, amplitude: {}, frequency: 0.5}}'.format

    def configuration(*lines):
        path.write_text(text + ''.join(f'    {line}\n' for line in lines))
        return load(str(path))

    record(configuration('drive: motion', law(0.2)), tmp_path / 'run.mcap', duration=1.0)
    verified(tmp_path / 'run.mcap')
    with pytest.raises(ConfigurationError, match=r't = 0\.5 s, .* the dyad ram does not close'):
        configuration('drive: motion', law(2.2))
    with pytest.raises(LinkageError, match='turn fully: the dyad ram '):
        configuration('rpm: 10.0')
    torque = configuration('drive: torque', 'motor: {torque: 60.0, damping: 4.0}', start)
    with pytest.raises(MotionError, match='ram_first and ram_second'):
        record(torque, tmp_path / 'end.mcap', duration=4.0)


ROD = Body(3.0, 0.5, 0.1, (1.0, 0.0))
ON_ROCKER = {'name': 'ram', 'from_': 'rocker', 'from_at': (0.5, 0.2)}
AT_DEAD_CENTRES = {
    'guide_on_frame': Dyad(**ON_ROCKER, first=ROD, slider=DyadSlider(1.0, (4.0, -1.0), 0.3)),
    'guide_on_coupler': Dyad(
        **ON_ROCKER, first=replace(ROD, length=6.0),
        slider=DyadSlider(1.0, (0.5, 0.2), 0.3, 'coupler', 0.2, (0.1, 0.2)),
    ),
    'barrel': Dyad(
        **ON_ROCKER, to='crank', to_at=(-1.5, 0.5), offset=0.2,
        barrel=Barrel(0.5, 0.1, (0.4, 0.1)), rod=Rod(0.5, 0.1, (-0.4, 0.1)),
    ),
}  # fmt: skip


@pytest.mark.parametrize('kind', AT_DEAD_CENTRES)
def test_free_motion_passes_a_dead_centre_of_the_loop_and_keeps_its_energy(tmp_path, kind):
    mechanism = replace(four_bar(LIMITED['rocker_crank'], 0.0), dyads=(AT_DEAD_CENTRES[kind],))
    values = {'mechanism': 'four_bar', 'drive': 'torque', 'motor.torque': 0.0, 'crank_angle': 1.5}
    record(configure(values | flatten(mechanism)), tmp_path / 'run.mcap', duration=4.0)
    verified(tmp_path / 'run.mcap')
    (log,) = [x for x in read_log(str(tmp_path / 'run.mcap')).values() if 'crank.effort' in x][:1]
    energies, sides = [], set()
    for row in range(0, 800, 20):
        for side in ('open', 'crossed'):
            solver = Solver(replace(mechanism, assembly=side))
            q, u = (float(log[f'crank.{x}'][row]) for x in ('position', 'velocity'))
            state = solver.state(q, u)
            gap = state['rocker'].position - log['rocker.position'][row]
            if abs(math.sin(0.5 * gap)) < 1e-6:
                sides.add(side)
                energies.append(sum(solver.energy(state)))
    assert sides == {'open', 'crossed'}
    assert len(energies) == 40
    assert np.ptp(energies) < 1e-6
