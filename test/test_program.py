# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The eight rules of programs: traced formulas keep their bits, and programs are readable."""

import ast
import functools
import gc
import itertools
import linecache
import math
import pickle
import struct
import traceback
import weakref
from dataclasses import dataclass, replace

import numpy as np
import pytest
from mechanisms import CYLINDERS, DOCUMENT_1, PUMPS, cylinder, four_bar, slider_crank

from linkage_ros import (
    Body,
    ConfigurationError,
    Coupler,
    Friction,
    LinkageError,
    LinkLoad,
    Solver,
    State,
    UnreachableError,
    WindPump,
)
from linkage_ros.formulas import Opaque, cos, is_finite, require, sin, sqrt, total, where
from linkage_ros.mechanism import equations
from linkage_ros.mechanism.joint_forces import reactions
from linkage_ros.mechanism.loads.base import AppliedLoad
from linkage_ros.mechanism.loads.link_load import LinkForce
from linkage_ros.mechanism.nested import leaves
from linkage_ros.mechanism.program import Constants, Program
from linkage_ros.mechanism.tracer import Tape

STRICT = np.errstate  # the original: a test replaces the package's


def massless(linkage):
    """Returns the linkage without any mass."""
    bodies = {name: Body(getattr(linkage, name).length) for name in ('crank', 'rocker')}
    return replace(linkage, coupler=Coupler(linkage.coupler.length), **bodies)


CRANK_ROCKER = four_bar((1.0, 3.0, 2.5, 2.2))
MECHANISMS = {
    'crank-rocker': CRANK_ROCKER,
    'straight links': DOCUMENT_1,
    'without gravity': replace(CRANK_ROCKER, gravity=(0.0, 0.0)),
    'loaded': replace(CRANK_ROCKER, loads=(LinkLoad('rocker', 3.0, 0.5),)),
    'change point': four_bar((1.0, 2.0, 2.5, 3.5), -2.0, 'crossed'),
    'rhombus': four_bar((1.5, 1.5, 1.5, 1.5)),
    'limited twice': four_bar((2.0, 1.5, 1.0, 2.2)),
    'nearly concentric': four_bar((1.0, 2.0, 2.001, 1.0005)),
    'limited by a hair': four_bar((1.0, 2.0, 2.5, 3.5 + 1e-14), -2.0, 'crossed'),
    'offset slider': slider_crank((0.3, 0.9, 0.2)),
    'limited slider': slider_crank((1.0, 0.9, 0.3), -2.0, 'crossed'),
    'slider at change points': slider_crank((1.0, 1.0, 0.0)),
    'cylinder': CYLINDERS['swinging_barrel'],
    'limited cylinder': cylinder((1.0, 2.2, 1.7)),
    'pump': PUMPS['pump'],
    'pump of equal links': replace(PUMPS['pump_open'], rod=Body(1.6, 3.0, 0.3, (0.9, -0.6))),
}
each = pytest.mark.parametrize('name', MECHANISMS)


@functools.cache
def programs_of(name):
    """Returns every program of a solver, by its formula."""
    solver = Solver(MECHANISMS[name])
    program = solver.program
    point = Constants((solver.structure.points['A'], solver.model.refuse))
    rows = tuple(
        tuple(f'{link}_{n}' for link in solver.links) for n in ('angle', 'speed', 'acceleration')
    )
    found = [
        program(equations.state, 'q', 'u'), program(equations.state, 'q', 'u', 'a'),
        program(equations.forward, 'q', 'u', 'torque'), program(equations.matrix, 'q'),
        program(equations.driven_state, 'q', 'u', 'torque'), program(equations.energy, 'q', 'u'),
        program(equations.dyad_sines, 'q', 'u'), program(reactions, 'q', 'u', 'a'),
        Program(equations.point_motion, point, rows),
    ]  # fmt: skip
    named = {program.formula.__name__: program for program in found[1:]}
    return {'steady': found[0], **named}


def inside(mechanism):
    """Returns coordinates within reach, away from singular positions."""
    if isinstance(mechanism, WindPump):
        return 0.4, 1.9
    start, end = mechanism.reach().arcs[0]
    return (start + 0.37 * (end - start),)


def columns(mechanism, program, count, seed=5):
    """Returns arguments of a program for many states, all within reach."""
    random = np.random.default_rng(seed)
    sizes = {'angle': 13.0, 'position': 13.0, 'speed': 30.0, 'velocity': 30.0,
             'acceleration': 200.0, 'torque': 90.0}  # fmt: skip
    found = [
        random.uniform(-1, 1, count) * sizes[name.rpartition('_')[2]] for name in program.names
    ]
    if isinstance(mechanism, WindPump):
        r, b, c = (getattr(mechanism, part).length for part in ('crank', 'coupler', 'rod'))
        found[1] = random.uniform(abs(b - c) + r + 0.1, b + c - r - 0.1, count)
    else:
        (start, end), share = mechanism.reach().arcs[0], random.uniform(0.02, 0.98, count)
        found[0] = start + share * (end - start)
    return found


def bits(tree):
    """Returns the bits of numbers in nested tuples; of an array, those of its first element."""
    numbers = leaves(tree[:4] if isinstance(tree, State) else tree)
    return b''.join(struct.pack('<d', np.ravel(x)[0]) for x in numbers)


def outcome(call, *values):
    """Returns the bits of a call's result; after a refusal, its type and message."""
    try:
        return bits(call(*values))
    except LinkageError as error:
        return type(error), str(error)


def forms_of(program):
    """Returns the program for floats, the formula, and the program for arrays."""

    def arrays(*values):
        return by_math(program)(*(np.full(2, value) for value in values))

    return program.floats, program.untraced, arrays


def by_math(program, *, traced=True):
    """Returns the same program with the functions of `math` for arrays."""
    return Program(
        program.formula, program.constants, program.arguments, traced=traced, by_math=True
    )


def operations(program):
    """Returns all operations of a program, as text."""
    kinds = ast.BinOp, ast.Call, ast.Compare, ast.IfExp
    return [ast.unparse(x) for x in ast.walk(ast.parse(program.tape.text)) if isinstance(x, kinds)]


# ------------------------------------------ 1 and 3: formulas run untraced, and bits are kept


@each
def test_all_forms_have_the_bytes_of_the_formula(name):
    """Includes zero speeds and zeros of either sign; refusals have the same message."""
    mechanism = MECHANISMS[name]
    random = np.random.default_rng(11)
    for kind, program in programs_of(name).items():
        for values in zip(*columns(mechanism, program, 12), strict=True):
            zeros = random.choice([1.0, 0.0, -0.0], len(values), p=[0.6, 0.2, 0.2])
            for row in (values, np.multiply(values, zeros)):
                found = {outcome(form, *map(float, row)) for form in forms_of(program)}
                assert len(found) == 1, (kind, row)


# ------------------------------------------ 2: only exact identities

SPECIAL = (0.0, -0.0, 1.5, -2.5, 5e-324, 1.7e308, math.inf, -math.inf, math.nan)


def folding(_, x):
    return x * 1, 1.0 * x, x / 1.0


def kept(_, x):
    return x * 0, 0.0 * x, x + 0.0, 0.0 + x, 0.0 - x, x - -0.0, x - x, x * -1.0, 1.0 - x, x - 1.0


def test_only_identities_that_hold_for_every_double_are_folded():
    folded, others = Program(folding, Constants(()), ('x',)), Program(kept, Constants(()), ('x',))
    assert operations(folded) == []
    assert len(set(operations(others))) == 10
    for x in SPECIAL:
        assert bits(folded.floats(x)) == bits((x,) * 3) == bits(folded.untraced(x))
        assert bits(others.floats(x)) == bits(others.untraced(x))
    # Two of the results differ from the folded form.
    assert bits(others.floats(-0.0)[2]) == bits(0.0)
    assert bits(others.floats(-1.5)[0]) == bits(-0.0)
    for divided in (lambda k, x: x / k, lambda k, _: k / k):
        with pytest.raises(ZeroDivisionError):
            Program(divided, Constants(0.0), ('x',)).floats(1.0)


class Fraction(float):
    """A subclass of float whose own arithmetic must not be used."""

    def __mul__(self, other):
        raise AssertionError

    __rmul__ = __add__ = __radd__ = __mul__


@pytest.mark.parametrize('traced', [True, False])
@pytest.mark.parametrize(
    'number', [np.float64(0.3), np.float32(0.3), Fraction(0.3), np.float64(0.0), 2, np.int64(2)]
)
def test_numbers_of_a_load_may_have_any_type_and_count_as_floats(number, traced):
    @dataclass(frozen=True)
    class Constant(AppliedLoad):
        number: object

        def on(self, _mechanism):
            return LinkForce(1, self.number, self.number, rest=self.number)

    found = []
    for value in (number, float(number)):
        solver = Solver(replace(DOCUMENT_1, loads=(Constant(value),)), traced=traced)
        state, many = (solver.state(q, 2.0, 1.5) for q in (0.3, np.linspace(0.3, 4.0, 5)))
        found.append((repr(state), repr(many), repr(solver.load_forces(state))))
        assert type(state.torque) is float
    assert found[0] == found[1]


@pytest.mark.parametrize('value', [[1.0, 2.0], np.array([1.0, 2.0]), {'k': 1.0}])
def test_a_constant_that_may_change_is_refused_in_one_line(value):
    with pytest.raises(ConfigurationError, match=r'a constant of a formula.*: must be a number'):
        Constants(((1.0, value), 2.0))


def test_absent_terms_are_removed_and_zero_values_kept():
    sources = [
        Solver(linkage).source
        for linkage in (massless(CRANK_ROCKER), MECHANISMS['without gravity'], CRANK_ROCKER)
    ]
    assert len(sources[0]) < len(sources[1]) < len(sources[2])
    assert Solver(replace(CRANK_ROCKER, gravity=(1e-300, -1e-300))).source == sources[2]


def test_a_quadrilateral_without_loads_computes_nothing_for_them():
    """The number of operations per state is the same as before loads and friction were added."""

    def counts(mechanism):
        program = Solver(mechanism).program
        programs = [
            program(equations.state, 'q', 'u'), program(equations.state, 'q', 'u', 'a'),
            program(equations.forward, 'q', 'u', 'torque'), program(equations.energy, 'q', 'u'),
        ]  # fmt: skip
        return [program.tape.operations for program in programs]

    bare = counts(DOCUMENT_1)
    assert all(count <= most for count, most in zip(bare, (133, 141, 141, 103), strict=True))
    nothing = LinkLoad('rocker'), Friction()
    assert counts(replace(DOCUMENT_1, loads=nothing)) == bare
    braked = counts(replace(DOCUMENT_1, loads=(LinkLoad('rocker', damping=1.0),)))
    assert all(count > least for count, least in zip(braked[:3], bare[:3], strict=True))


# ------------------------------------------ 4: no branches; guards come first


@pytest.mark.parametrize(
    'used',
    [lambda x: x if x > 0 else -x, lambda x: x == 1.0, lambda x: 0 < x < 1, lambda x: max(x, 0.0),
     hash, float, math.sin, np.sin],
)  # fmt: skip
def test_traced_number_cannot_be_used_as_a_value(used):
    used(0.5)  # a float has a value

    def formula(_, x):
        return used(x)

    with pytest.raises(TypeError):
        Program(formula, Constants(()), ('x',)).floats(0.5)


def refuse(x):
    raise UnreachableError(f'x = {x:g} is out of reach', crank_angle=x, arcs=())


def guarded(refusal, x):
    require(x >= 0, refusal, x)
    return sqrt(x) / 2


def guarded_late(refusal, x):
    root = sqrt(x)
    require(x >= 0, refusal, x)
    return root, root  # a term that is used once is computed where it is used


@pytest.fixture
def strict(monkeypatch):
    """Makes floating-point errors strict where the package relaxes them."""
    monkeypatch.setattr(np, 'errstate', lambda **_: STRICT(all='raise', under='ignore'))


@pytest.mark.usefixtures('strict')
def test_guard_runs_before_the_guarded_operation():
    program = Program(guarded, Constants(Opaque(refuse)), ('x',))
    for call in (*forms_of(program), lambda x: program(np.array([4.0, x, 1.0]))):
        assert bits(call(4.0)) == bits(1.0)
        with pytest.raises(UnreachableError, match='x = -1 is out of reach'):
            call(-1.0)


@pytest.mark.parametrize(
    ('made', 'values'),
    [(lambda x, y: x - 3.0 * y, 1), (lambda x, y: abs(x - y) * (x / 2), 1),
     (lambda x, y: x / y, 2), (lambda x, y: where(x > y, x, y), 3)],
)  # fmt: skip
def test_guard_of_finite_values_checks_only_as_many_as_necessary(made, values):
    def formula(refusal, x, y):
        found = made(x, y)
        require(is_finite(found, x, y), refusal, x)
        return found

    program = Program(formula, Constants(Opaque(refuse)), ('x', 'y'))
    checked = [x for x in program.tape.lines if x.operation == '-' and len({*x.operands}) == 1]
    assert len(checked) == values
    assert bits(program.floats(1.5, 2.0)) == bits(program.untraced(1.5, 2.0))
    for x, y in itertools.product((1.5, math.inf, -math.inf, math.nan), repeat=2):
        if (x, y) != (1.5, 1.5):
            with pytest.raises(UnreachableError):
                program.floats(x, y)


@pytest.mark.usefixtures('strict')
def test_late_guard_is_detected():
    late = Program(guarded_late, Constants(Opaque(refuse)), ('x',))
    with pytest.raises(ValueError, match='math domain error'):
        late.floats(-1.0)
    with pytest.raises(FloatingPointError):
        late(np.array([-1.0, -1.0]))


def near(x):
    """Returns a number, its neighbours, and numbers a little farther away."""
    gaps = (1e-12, -1e-7, 1e-3)
    return [x, math.nextafter(x, math.inf), math.nextafter(x, -math.inf), *(x + y for y in gaps)]


def singular_places(mechanism):
    """Returns coordinates at and next to ends of the reach, change points, and dead centres."""
    if isinstance(mechanism, WindPump):
        r, b, c = (getattr(mechanism, part).length for part in ('crank', 'coupler', 'rod'))
        ends = [r + sign * span for span in (b + c, abs(b - c)) for sign in (-1, 1)]
        return [(0.0, place) for end in (*ends, r, -r, -0.0, 9.0) for place in near(end)]
    reach = mechanism.reach()
    ends = [end for arc in reach.arcs for end in arc]
    lines = [reach.fast + turn * math.pi / 2 for turn in range(-2, 3)]
    return [(place,) for angle in (*ends, *lines, -0.0) for place in near(angle)]


def refusal_of(form, *values):
    """Returns the error message of a program; empty if its results are finite."""
    try:
        found = form(*values)
    except LinkageError as error:
        return str(error)
    assert all(np.isfinite(x).all() for x in leaves(found)), values
    return ''


@pytest.mark.usefixtures('strict')
@each
def test_singular_places_raise_no_warning_and_give_no_nan(name):
    mechanism, refused = MECHANISMS[name], 0
    places = singular_places(mechanism)
    for kind, program in programs_of(name).items():
        if kind == 'point_motion':
            continue  # this state has no singular position
        names = program.names[len(places[0]) :]
        motion = [
            {'speed': 1.5, 'acceleration': -3.0, 'torque': 2.0}[n.rpartition('_')[2]]
            for n in names
        ]
        for place in places:
            words = {refusal_of(form, *place, *motion) for form in forms_of(program)}
            assert len(words) == 1, (kind, place, words)
            refused += words != {''}
    reach = mechanism.reach()
    expected = reach is None or not reach.turns_fully or reach.has_change_point
    assert (refused > 0) == expected


# ------------------------------------------ 5: arrays


@each
def test_untraced_arrays_have_the_bits_of_traced_ones(name):
    """The formulas themselves run on arrays, with NumPy's functions and with those of `math`."""
    mechanism = MECHANISMS[name]
    for kind, program in programs_of(name).items():
        given = columns(mechanism, program, 20)
        plain = Program(program.formula, program.constants, program.arguments, traced=False)
        pairs = (program, plain), (by_math(program), by_math(program, traced=False))
        with_a_float = (given[0][0].item(), *given[1:])
        for pair, values in itertools.product(pairs, (given, with_a_float)):
            for one, other in zip(*(np.array(leaves(x(*values))) for x in pair), strict=True):
                assert np.array_equal(one.view(np.int64), other.view(np.int64)), kind


# ------------------------------------------ 6: a program can be read, pickled and shared


def frames(error):
    """Returns the frames of a traceback that are in programs."""
    found = traceback.extract_tb(error.__traceback__)
    return [frame for frame in found if frame.filename.startswith('<')]


def test_tracebacks_show_the_line_of_the_program():
    solver = Solver(CRANK_ROCKER)
    with pytest.raises(ConfigurationError) as raised:
        solver.state(math.nan, 1.0, 2.0)
    *_, frame = frames(raised.value)
    assert frame.line == solver.source.splitlines()[frame.lineno - 1].strip()
    assert frame.line.startswith('if not')


def test_each_structure_is_compiled_once_and_bound_to_its_numbers():
    other = four_bar((2, 7, 9, 6))
    solvers = [Solver(x) for x in (CRANK_ROCKER, other, massless(other))]
    assert solvers[0].source == solvers[1].source != solvers[2].source
    assert solvers[0].state(0.3, 1.0) != solvers[1].state(0.3, 1.0)
    one, same = (Program(with_table, Constants((Opaque(f), 0.8)), ('x',)) for f in (lookup, abs))
    assert one.tape is same.tape
    assert one.floats(1.0) != same.floats(1.0)


def test_least_recently_used_structures_leave_memory():
    def program(number):  # zeros belong to the structure
        numbers = [float(bit) for bit in f'{number:b}']
        return Program(weighted, Constants((1.5, *numbers)), ('x',))

    kept, used = program(1), [program(1).tape]
    tapes = weakref.WeakSet[Tape]()
    for number in range(1000, 1300):
        tape = program(number).tape
        tape.for_floats(*program(number).constants.numbers)
        tapes.add(tape)
        used.append(program(1).tape)
    path = tape.for_floats.__code__.co_filename
    assert path in linecache.cache
    del tape
    gc.collect()
    assert len(tapes) < 100
    texts = [name for name in linecache.cache if name.startswith('<weighted')]
    assert len(texts) < 101
    assert {*map(id, used)} == {id(kept.tape)}  # the structure in use stays


def weighted(constants, x):
    return sum(a * sin(x) for a in constants)


@pytest.mark.parametrize('name', ['loaded', 'pump'])
def test_solvers_pickle_by_description(name):
    solver = Solver(MECHANISMS[name])
    q = inside(solver.mechanism)
    u = (1.0,) * len(q)
    before = solver.state(q, u, u)
    text = pickle.dumps(solver)
    assert bits(pickle.loads(text).state(q, u, u)) == bits(before)
    assert len(text) < len(pickle.dumps(solver.mechanism)) + 250


def test_a_state_is_a_named_tuple_that_pickles():
    state = Solver(CRANK_ROCKER).state(0.3, 1.0)
    assert isinstance(state, State)
    assert state._replace(torque=2.0) == State(*state[:3], 2.0) != state
    assert state['rocker'] == tuple(row[2] for row in state[:3])
    with pytest.raises(ConfigurationError, match='rocker'):
        state['roker']
    again = pickle.loads(pickle.dumps(state))
    assert type(again) is State
    assert bits(again[:4]) == bits(state[:4])
    assert again[4:] == state[4:]


# ------------------------------------------ 7: opaque functions, loops


def lookup(x):
    return np.interp(x, [0.0, 1.0, 2.5, 4.0], [0.3, 1.7, -0.4, 2.0])


def with_table(constants, x):
    table, factor = constants
    height = table(x * factor)
    return height + sin(height), where(height > 1, height, 1.0)


def test_table_works_in_all_forms_and_appears_in_tracebacks():
    program = Program(with_table, Constants((Opaque(lookup), 0.8)), ('x',))
    for x in np.linspace(-1, 6, 50).tolist():
        height = float(lookup(x * 0.8))
        expected = bits((height + math.sin(height), max(height, 1.0)))
        assert {bits(form(x)) for form in forms_of(program)} == {expected}
    broken = Program(with_table, Constants((Opaque(lambda _: 1 / 0), 2.0)), ('x',))
    for call in (lambda: broken.floats(1.0), lambda: broken(np.array([1.0, 1.0]))):
        with pytest.raises(ZeroDivisionError) as raised:
            call()
        assert [' = k_0(' in frame.line for frame in frames(raised.value)] == [True]


def series(factors, x):
    angles = [x * n for n in range(1, len(factors) + 1)]
    return total(f * cos(angle) for f, angle in zip(factors, angles, strict=True))


def halved(_, x, target):
    return x - (x * x - target) / (2 * x)


def test_sums_may_be_long_and_programs_may_contain_loops():
    """Python allows at most 200 nested parentheses; loops, as for friction, keep their bits."""
    program = Program(series, Constants(tuple(1.0 / n for n in range(1, 401))), ('x',))
    assert len({bits(form(0.7)) for form in forms_of(program)}) == 1
    program, targets = Program(halved, Constants(()), ('x', 'target')), np.linspace(1, 9, 50)
    x, xs = [1.0] * len(targets), np.ones(len(targets))
    for _ in range(8):
        x = [program.floats(*pair) for pair in zip(x, targets.tolist(), strict=True)]
        xs = program(xs, targets)
        assert xs.tolist() == x
    assert np.allclose(xs, np.sqrt(targets), rtol=1e-15)
