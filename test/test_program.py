# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rules of programs: what is traced has the bits of the formulas, and can be read."""

from __future__ import annotations

import ast
import itertools
import math
import operator
import pickle
import struct
import subprocess
import sys
import threading
import traceback
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pytest
from house import PACKAGE, ROOT

import linkage_ros.dynamics.solver as solver_module
from linkage_ros import (
    Body,
    ConfigurationError,
    Coupler,
    FourBar,
    Frame,
    Guide,
    LinkageError,
    MechanismError,
    Piston,
    Slider,
    SliderCrank,
    Solver,
    UnreachableError,
    WindPump,
)
from linkage_ros.dynamics.program import Program
from linkage_ros.formulas import Opaque, atan2, cos, require, sin, sqrt, total, where
from linkage_ros.model.loads import LinkLoad
from linkage_ros.parameters.configuration import load

STRICT = np.errstate  # the real one: a test replaces the package's


# ---------------------------------------------------------------- mechanisms of every structure


def four_bar(lengths, angle=0.0, assembly='open', bodies=(), gravity=(0.0, -9.81), cls=FourBar):
    r, b, c, d = lengths
    crank, coupler, rocker = (*bodies, {}, {}, {})[:3]
    return cls(
        Frame(d, angle), Body(r, **crank), Coupler(b, **coupler), Body(c, **rocker), assembly,
        gravity,
    )  # fmt: skip


@dataclass(frozen=True)
class Loaded(FourBar):
    """A four-bar against whose rocker something works."""

    def loads(self):
        return (LinkLoad(2, 3.0, 0.5),)


HEAVY = (
    {'mass': 0.7, 'inertia': 0.02, 'center': (0.3, -0.2)},
    {'mass': 2.0, 'inertia': 0.5, 'center': (0.8, 0.9), 'point': (0.4, -0.3)},
    {'mass': 3.0, 'inertia': 0.3, 'center': (1.0, -0.6)},
)
STRAIGHT = tuple({**body, 'center': (body['center'][0], 0.0)} for body in HEAVY)
LENGTHS = {
    'crank-rocker': (1.0, 3.0, 2.5, 2.2),
    'double-crank': (2.0, 1.8, 1.9, 1.0),
    'change point far': (1.0, 2.0, 2.5, 3.5),
    'change point near': (1.0, 3.5, 2.0, 2.5),
    'change point across': (1.0, 2.0, 3.5, 2.5),
    'parallelogram': (1.0, 2.0, 1.0, 2.0),
    'kite': (2.0, 1.0, 1.0, 2.0),
    'kite of a long coupler': (1.0, 2.0, 2.0, 1.0),
    'kite about the coupler': (1.0, 1.0, 2.0, 2.0),
    'rhombus': (1.5, 1.5, 1.5, 1.5),
    'limited far': (0.9, 0.5, 0.6, 1.0),
    'limited near': (1.0, 2.4, 1.0, 1.2),
    'limited twice': (2.0, 1.5, 1.0, 2.2),
    'nearly concentric': (1.0, 2.0, 2.001, 1.0005),
    'nearly concentric, alike': (1.0, 2.0, 2.0, 1.01),
    'missed by a hair': (1.0, 2.0, 2.5, 3.5 - 1e-14),
    'limited by a hair': (1.0, 2.0, 2.5, 3.5 + 1e-14),
}
GUIDES = {
    'in line': (0.3, 0.9, 0.0),
    'offset': (0.3, 0.9, 0.2),
    'limited': (1.0, 0.6, 0.0),
    'limited on one side': (1.0, 0.9, 0.3),
    'change point': (1.0, 1.0, 0.0),
    'change point of an offset': (0.75, 1.0, 0.25),
    'change point of an offset below': (0.75, 1.0, -0.25),
}
PUMP = load('wind_pump').mechanism
LIGHT_PUMP = WindPump(Body(0.12), Coupler(0.8), Body(1.6), Piston(1.5), 'open')


def sliding(lengths, angle=0.0, assembly='open', slider=None, bodies=(), gravity=(0.0, -9.81)):
    r, b, e = lengths
    crank, coupler = (*bodies, {}, {})[:2]
    return SliderCrank(
        Body(r, **crank), Coupler(b, **coupler), Slider(e, **(slider or {})), Guide(angle),
        assembly, gravity,
    )  # fmt: skip


def every_mechanism():
    for name, lengths in LENGTHS.items():
        yield name, four_bar(lengths, 0.3, 'open', HEAVY)
        yield f'{name}, crossed', four_bar(lengths, -2.0, 'crossed', STRAIGHT, (1.3, -9.7))
    usual = LENGTHS['crank-rocker']
    yield 'massless', four_bar(usual)
    yield 'without gravity', four_bar(usual, 7.5, 'open', HEAVY, (0.0, 0.0))
    yield 'loaded', four_bar(usual, 0.0, 'crossed', HEAVY, cls=Loaded)
    yield 'loaded, massless', four_bar(usual, 0.0, 'open', cls=Loaded)
    yield 'with a coupler alone', four_bar(usual, 0.4, 'open', ({}, HEAVY[1]))
    yield 'with a crank alone', four_bar(usual, 0.4, 'open', HEAVY[:1])
    yield 'with a rocker alone', four_bar(usual, 0.4, 'open', ({}, {}, HEAVY[2]))
    slider = {'mass': 3.0, 'force': 4.0, 'damping': 0.5}
    for name, lengths in GUIDES.items():
        yield f'guide, {name}', sliding(lengths, 0.7, 'open', slider, HEAVY)
        yield f'guide, {name}, crossed', sliding(lengths, -2.0, 'crossed', {'mass': 1.0}, STRAIGHT)
    usual = GUIDES['offset']
    yield 'guide, massless', sliding(usual)
    yield 'guide, force alone', sliding(usual, 0.7, 'open', {'force': 4.0})
    yield 'guide, damping alone', sliding(usual, 0.7, 'open', {'damping': 0.5}, gravity=(0.0, 0.0))
    yield 'pump', PUMP
    yield 'pump, open', replace(PUMP, assembly='open', gravity=(1.3, -9.7))
    yield 'pump, undamped', replace(PUMP, slider=replace(PUMP.slider, damping=0.0))
    yield 'pump, massless', LIGHT_PUMP
    yield 'pump of equal links', replace(PUMP, rod=replace(PUMP.rod, length=0.8))


MECHANISMS = dict(every_mechanism())
PRESETS = ('quadrilateral', 'coupler_point', 'compressor', 'wind_pump')
each = pytest.mark.parametrize('name', MECHANISMS)


def programs_of(mechanism):
    """Every program that a solver of the mechanism asks for, by what it computes."""
    kept = {}

    class Kept(Program):
        def __init__(self, formula, constants, arguments):
            super().__init__(formula, constants, arguments)
            kept[f'{formula.__name__} {len(kept)}'] = self

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solver_module, 'Program', Kept)
        solver = Solver(mechanism)
        q, u, a = inside(mechanism), (1.0, 0.5), (0.2, -0.3)
        count = len(solver.coordinates)
        u, a = u[:count], a[:count]
        state = solver.state(q, u, (0.0,) * count)
        calls = (
            lambda: solver.state(q, u, a),
            lambda: solver.accelerations(q, u, 1.0),
            lambda: solver.energy(q, u),
            lambda: solver.matrix(q),
            lambda: solver.alignment(q),
            lambda: solver.reactions(state),
            *(lambda point=point: solver.point(state, point) for point in solver.structure.points),
        )
        for call in calls:
            with suppress(MechanismError):
                call()
    assert {'state', 'forward', 'energy', 'matrix', 'reactions'} <= {x.split()[0] for x in kept}
    return {kind: program for kind, program in kept.items() if not lacks_mass(program)}


def lacks_mass(program):
    """Whether a program refuses all that it is asked."""
    try:
        program.scalar(*([math.nan] * len(inputs(program))))
    except MechanismError:
        return True
    except LinkageError:
        pass
    return False


def inside(mechanism):
    """Coordinates that the mechanism reaches, in no special place."""
    if isinstance(mechanism, WindPump):
        return 0.4, 1.5
    start, end = mechanism.reach().arcs[0]
    return (start + 0.37 * (end - start),)


def inputs(program):
    """The names of a program's arguments."""
    _, (inner,) = parts(program)
    return [argument.arg for argument in inner.args.args]


def drawn(mechanism, program, random):
    """Arguments of a program, often zeros of either sign, now and then out of reach."""
    values, names = [], inputs(program)
    for name in names:
        sizes = {'q': 13.0, 'u': 30.0, 'a': 200.0, 'e': 200.0, 't': 90.0}
        value = float(random.uniform(-1, 1)) * sizes[name[0]]
        if isinstance(mechanism, WindPump) and name == names[1] and len(names) < 7:
            value = float(random.choice([-1, 1]) * random.uniform(0.8, 2.5))
        if random.random() < 0.25:
            value = float(random.choice([0.0, -0.0]))
        values.append(value)
    return values


OPERATIONS = ast.BinOp, ast.Call, ast.Compare, ast.IfExp


def parts(program):
    """The statements that bind a program's constants, and the program itself."""
    (bind,) = ast.parse(program.source).body
    *before, inner, _ = bind.body
    return before, [inner]


def operations(program):
    """All that a program computes, as text."""
    before, (inner,) = parts(program)
    nodes = [node for part in (*before, *inner.body) for node in ast.walk(part)]
    return [ast.unparse(node) for node in nodes if isinstance(node, OPERATIONS)]


def leaves(tree):
    return [x for part in tree for x in leaves(part)] if isinstance(tree, tuple) else [tree]


def first_of(tree):
    """The first state of arrays."""
    return tuple(float(x[0]) for x in leaves(tree))


def bits(tree):
    """Numbers of nested tuples, to the bit."""
    return b''.join(struct.pack('<d', x) for x in leaves(tree))


def outcome(call, *values):
    """The bits of what a call returns; of a refusal its kind and words."""
    try:
        return bits(call(*values))
    except LinkageError as error:
        return type(error), str(error)


# ---------------------------------------------------------------- 1: formulas know nothing of it


@each
def test_untraced_formulas_give_the_bytes_of_the_program(name):
    mechanism, random = MECHANISMS[name], np.random.default_rng(11)
    for kind, program in programs_of(mechanism).items():
        refused = 0
        for _ in range(15):
            values = drawn(mechanism, program, random)
            found = outcome(program.scalar, *values)
            assert found == outcome(program.untraced, *values), (kind, values)
            refused += isinstance(found, tuple)
        assert refused < 15, kind


def test_bytes_tell_signed_zeros_and_refusals_apart():
    assert bits((0.0, (1.0,))) != bits((-0.0, (1.0,)))
    assert bits(1.0) != bits(math.nextafter(1.0, 2.0))
    beyond = Solver(MECHANISMS['limited far'])
    assert outcome(beyond.state, beyond.mobility.arcs[0][1] + 0.1)[0] is UnreachableError


def statements(text):
    """Statements of a source, docstrings left out."""
    return sum(
        isinstance(node, ast.stmt)
        and not (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        )
        for node in ast.walk(ast.parse(text))
    )


def test_the_tracer_is_one_file_of_200_statements_at_most():
    assert statements('"""A docstring."""\ndef f():\n    """Another."""\n    a = 1; b = 2\n') == 3
    assert statements((PACKAGE / 'dynamics' / 'program.py').read_text()) <= 200


def test_no_formula_knows_that_it_is_traced():
    """Formulas import nothing of the tracer, and ask no value what kind of number it is."""
    formulas = [
        *(PACKAGE / 'model').glob('*.py'),
        *(PACKAGE / 'dynamics' / f'{name}.py' for name in ('equations', 'reactions', 'state')),
    ]
    assert len(formulas) > 8
    for path in formulas:
        text = path.read_text()
        assert 'dynamics.program' not in text, path
        assert 'Recorder' not in text, path
        assert 'hasattr' not in text, path


# ---------------------------------------------------------------- 2: exact identities alone

SPECIAL = (0.0, -0.0, 1.5, -2.5, 5e-324, 1.7e308, math.inf, -math.inf, math.nan)


def folding(_, x):
    return x * 1, 1.0 * x, x / 1.0, x - 0.0, x + -0.0, -0.0 + x


def kept(_, x):
    return x * 0, 0.0 * x, x + 0.0, 0.0 + x, 0.0 - x, x - -0.0, x - x, x * -1.0, 1.0 - x


def test_what_is_x_for_every_double_falls_out():
    program = Program(folding, (), ('x',))
    assert operations(program) == []
    for x in SPECIAL:
        assert bits(program.scalar(x)) == bits((x,) * 6) == bits(program.untraced(x))


def test_what_is_not_stays():
    program = Program(kept, (), ('x',))
    assert len(operations(program)) == len(set(operations(program))) == 9
    for x in SPECIAL:
        assert bits(program.scalar(x)) == bits(program.untraced(x))
    # Each would be told from its folded form.
    assert bits(program.scalar(-0.0)[2]) == bits(0.0) != bits(-0.0)
    assert bits(program.scalar(-1.5)[0]) == bits(-0.0) != bits(0.0)


def test_numbers_that_are_zero_take_part_and_terms_that_are_none_do_not():
    """A structural zero is None in the constants; a number that happens to be 0 is computed."""
    heavy, light = MECHANISMS['crank-rocker'], MECHANISMS['massless']

    def size(mechanism):
        return len(operations(programs_of(mechanism)['state 1']))

    assert size(light) < size(MECHANISMS['with a crank alone']) < size(heavy)
    assert size(MECHANISMS['without gravity']) < size(heavy)
    assert size(replace(heavy, gravity=(0.0, -1e-300))) == size(heavy)


# ---------------------------------------------------------------- 3: the order of operations


def sums(_, x, y, z):
    return (x + y) + z, x + (y + z), (x * y) * z, x * (y * z), x - y + z, x - (y - z)


def test_the_order_of_operations_is_kept():
    program, random = Program(sums, (), ('x', 'y', 'z')), np.random.default_rng(3)
    told_apart = 0
    for values in random.uniform(-1, 1, (200, 3)) * [1, 1e8, 1e16]:
        found = program.scalar(*values.tolist())
        assert bits(found) == bits(program.untraced(*values.tolist()))
        told_apart += found[0] != found[1]
    assert told_apart > 20


@each
def test_signed_zeros_are_kept_at_rest_and_at_the_origin(name):
    mechanism = MECHANISMS[name]
    zeros = 0.0, -0.0
    for kind, program in programs_of(mechanism).items():
        names = inputs(program)
        if kind.startswith('_point'):
            continue
        fixed = [(*inside(mechanism), *zeros)[:1] if n[0] == 'q' else zeros for n in names]
        if len(inside(mechanism)) == 2:
            fixed[0], fixed[1] = (*inside(mechanism)[:1], *zeros), inside(mechanism)[1:]
        else:
            fixed[0] = (*inside(mechanism), *zeros)
        for values in itertools.product(*fixed):
            row = [np.array([value]) for value in values]
            found = outcome(program.scalar, *values)
            assert found == outcome(program.untraced, *values), (kind, values)
            of_arrays = outcome(lambda *x, p=program: first_of(p.arrays(*x, by_math=True)), *row)
            assert found == of_arrays, (kind, values)


# ---------------------------------------------------------------- 4: no branches, guards first


def refuse(x):
    raise UnreachableError(f'x = {x:g} is out of reach', crank_angle=x, arcs=())


def with_if(_, x):
    return x if x > 0 else -x


def with_equality(_, x):
    return x == 1.0


def with_inequality(_, x):
    return x != 1.0


def with_and(_, x):
    return x > 0 and x < 1


def with_chain(_, x):
    return 0 < x < 1


def with_not(_, x):
    return not x


def with_max(_, x):
    return max(x, 0.0)


def with_membership(_, x):
    return x in (1.0, 2.0)


def with_where(_, x):
    return where(x > 0, x, -x)


@pytest.mark.parametrize(
    'formula',
    [with_if, with_equality, with_inequality, with_and, with_chain, with_not, with_max,
     with_membership],
)  # fmt: skip
def test_a_recording_number_has_no_truth_value(formula):
    formula((), 0.5)  # a float has one
    with pytest.raises(TypeError, match=r'cannot branch on a value: use where\(\) or require\(\)'):
        Program(formula, (), ('x',)).scalar(0.5)


def test_a_recording_number_is_no_key_no_float_and_nothing_for_numpy():
    def used(use):
        def formula(_, x):
            use(x)
            return x

        formula.__name__ = 'formula'
        return formula

    for use in (hash, float, math.sin, np.sin, int):
        Program(used(abs), (), ('x',)).scalar(0.5)
        with pytest.raises(TypeError):
            Program(used(use), (), ('x',)).scalar(0.5)


def test_where_chooses_in_all_three_forms():
    program = Program(with_where, (), ('x',))
    xs = np.array([-2.0, -0.0, 0.0, 3.0])
    one_by_one = [program.scalar(x) for x in xs.tolist()]
    assert bits(tuple(one_by_one)) == bits(tuple(map(program.untraced, xs.tolist())))
    assert bits(tuple(program.arrays(xs).tolist())) == bits(tuple(one_by_one))
    assert one_by_one == [2.0, 0.0, 0.0, 3.0]


def guarded(refusal, x):
    require(x >= 0, refusal, x)
    return sqrt(x) / 2


def guarded_division(refusal, x):
    require(abs(x) > 0, refusal, x)
    return 1 / x


def guarded_late(refusal, x):
    root = sqrt(x)
    require(x >= 0, refusal, x)
    return root


def unguarded(_, x):
    return 1 / x


def loose(**_):
    """The state of errors that the package asks for, made strict."""
    return STRICT(all='raise', under='ignore')


@pytest.fixture
def strict(monkeypatch):
    monkeypatch.setattr(np, 'errstate', loose)


@pytest.mark.usefixtures('strict')
@pytest.mark.parametrize(('formula', 'bad'), [(guarded, -1.0), (guarded_division, 0.0)])
def test_a_guard_refuses_before_what_it_protects(formula, bad):
    program = Program(formula, Opaque(refuse), ('x',))
    for call in (program.scalar, program.untraced):
        assert outcome(call, 4.0) == bits(formula(None, 4.0))
        with pytest.raises(UnreachableError, match=f'x = {bad:g} is out of reach'):
            call(bad)
    for by_math in (False, True):
        assert program.arrays(np.array([4.0]), by_math=by_math) == formula(None, 4.0)
        with pytest.raises(UnreachableError, match=f'x = {bad:g} is out of reach'):
            program.arrays(np.array([4.0, bad, 1.0]), by_math=by_math)


@pytest.mark.usefixtures('strict')
def test_a_guard_that_comes_late_or_not_at_all_would_be_seen():
    late, none = Program(guarded_late, Opaque(refuse), ('x',)), Program(unguarded, (), ('x',))
    with pytest.raises(ValueError, match='math domain error'):
        late.scalar(-1.0)
    with pytest.raises(ZeroDivisionError):
        none.scalar(0.0)
    for program, bad in ((late, -1.0), (none, 0.0)):
        with pytest.raises(FloatingPointError):
            program.arrays(np.array([bad]))


def always_refused(refusal, x):
    require(False, refusal, x)
    return 1 / x


def test_a_guard_that_the_structure_decides_stands_too():
    program = Program(always_refused, Opaque(refuse), ('x',))
    for call in (program.untraced, program.scalar, lambda x: program.arrays(np.array([x]))):
        with pytest.raises(UnreachableError, match='x = 0 is out of reach'):
            call(0.0)


def test_what_has_no_mass_is_refused_before_its_matrix_divides():
    for name in ('massless', 'guide, massless', 'pump, massless'):
        solver = Solver(MECHANISMS[name])
        q = inside(solver.mechanism)
        for u in (0.0, np.zeros(3)):
            with pytest.raises(MechanismError, match='moves without a mass'):
                solver.accelerations(q, (u,) * len(q), 1.0)


def near(x):
    """A number, its neighbours, and numbers a little farther off."""
    yield from (x, math.nextafter(x, math.inf), math.nextafter(x, -math.inf))
    for gap in (1e-12, 1e-7, 1e-3):
        yield from (x - gap, x + gap)


def singular_places(mechanism):
    """Coordinates at and next to the ends of the reach, change points, and dead centres."""
    if isinstance(mechanism, WindPump):
        r, b, c = (getattr(mechanism, part).length for part in ('crank', 'coupler', 'rod'))
        for crank in (0.0, math.pi, 2.5):
            x, y = r * math.cos(crank), r * math.sin(crank)
            spans = [math.sqrt(max(far * far - y * y, 0.0)) for far in (b + c, abs(b - c))]
            ends = [x + sign * span for span in spans for sign in (-1, 1)]
            for slide in (*ends, r, -r, 0.0, -0.0, 9.0):
                yield from ((crank, place) for place in near(slide))
        return
    reach = mechanism.reach()
    ends = [end for arc in reach.arcs for end in arc]
    lines = [reach.fast + turn * math.pi / 2 for turn in range(-4, 5)]
    for angle in (*ends, *(end - 2 * math.pi for end in ends), *lines, 0.0, -0.0):
        yield from ((place,) for place in near(angle))


@pytest.mark.usefixtures('strict')
@each
def test_no_program_needs_an_exception_a_nan_or_a_warning_of_its_backend(name):
    mechanism, refused = MECHANISMS[name], 0
    places = list(singular_places(mechanism))
    for kind, program in programs_of(mechanism).items():
        if kind.startswith('_point'):
            continue  # of a state: it has no singular place
        forms = (
            program.scalar,
            program.untraced,
            lambda *x, p=program: p.arrays(*map(np.atleast_1d, x)),
        )
        names = inputs(program)[len(places[0]) :]
        motion = [{'u': 1.5, 'a': -3.0, 't': 2.0}[n[0]] for n in names]
        for place in places:
            words = {refusal_of(form, *place, *motion) for form in forms}
            assert len(words) == 1, (kind, place, words)
            refused += words != {''}
    assert (refused > 0) == expects_refusals(mechanism)


def refusal_of(form, *values):
    """The words with which a form of a program refuses; empty: its results are finite."""
    try:
        found = form(*values)
    except LinkageError as error:
        return str(error)
    assert all(map(np.isfinite, leaves(found))), values
    return ''


def expects_refusals(mechanism):
    """Whether some place cannot be reached, or has no forces in its joints."""
    reach = mechanism.reach()
    return reach is None or not reach.turns_fully or reach.has_change_point


# ---------------------------------------------------------------- 5: arrays

STATES = 100_000


def columns(mechanism, program, count, seed=5):
    """Arguments of a program for many states, all inside the reach."""
    random, found = np.random.default_rng(seed), []
    for name in inputs(program):
        sizes = {'q': 13.0, 'u': 30.0, 'a': 200.0, 'e': 200.0, 't': 90.0}
        found.append(random.uniform(-1, 1, count) * sizes[name[0]])
    if isinstance(mechanism, WindPump):
        r, b, c = (getattr(mechanism, part).length for part in ('crank', 'coupler', 'rod'))
        found[1] = random.choice([-1, 1], count) * random.uniform(
            abs(b - c) + r + 0.1, b + c - r - 0.1, count
        )
    elif not mechanism.reach().turns_fully:
        (start, end), share = mechanism.reach().arcs[0], random.uniform(0.02, 0.98, count)
        found[0] = start + share * (end - start)
    return found


def differing(program, given, *, by_math):
    """How many states of arrays differ in a bit from those of the scalar program."""
    arrays = np.array(leaves(program.arrays(*given, by_math=by_math))).T.copy()
    rows = zip(*(x.tolist() for x in given), strict=True)
    scalars = np.array([leaves(program.scalar(*row)) for row in rows])
    return int((arrays.view(np.int64) != scalars.view(np.int64)).any(1).sum())


@pytest.mark.parametrize('name', PRESETS)
def test_arrays_by_math_have_the_bits_of_the_scalar_program(name):
    mechanism = load(name).mechanism
    told_apart = 0
    for kind, program in programs_of(mechanism).items():
        if kind.startswith(('state', 'forward')):
            given = columns(mechanism, program, STATES)
            assert differing(program, given, by_math=True) == 0, kind
            few = [x[:2000] for x in given]
            told_apart += differing(program, few, by_math=False)
    assert told_apart > 0, 'the comparison would see no last bit'


@each
def test_arrays_by_math_of_every_program_do(name):
    mechanism = MECHANISMS[name]
    for kind, program in programs_of(mechanism).items():
        given = columns(mechanism, program, 500)
        assert differing(program, given, by_math=True) == 0, kind


@pytest.mark.parametrize('name', PRESETS)
def test_floats_among_arrays_give_what_arrays_of_them_give(name):
    mechanism = load(name).mechanism
    for program in programs_of(mechanism).values():
        given = columns(mechanism, program, 50)
        for chosen in itertools.product([False, True], repeat=min(len(given), 4)):
            held = [*chosen, *([True] * len(given))][: len(given)]
            if all(held):
                continue
            mixed = [float(x[0]) if fix else x for x, fix in zip(given, held, strict=True)]
            full = [np.broadcast_to(x, 50) for x in mixed]
            for by_math in (False, True):
                one, other = (program.arrays(*x, by_math=by_math) for x in (mixed, full))
                pairs = zip(leaves(one), leaves(other), strict=True)
                # NumPy's own sine of one number need not be that of many.
                near = {'rtol': 0.0 if by_math else 1e-12, 'atol': 0.0 if by_math else 1e-9}
                assert all(np.allclose(x, y, **near) for x, y in pairs)


@pytest.mark.parametrize('name', PRESETS)
def test_numpys_own_functions_stay_within_4_ulp_of_the_largest(name):
    mechanism = load(name).mechanism
    for kind, program in programs_of(mechanism).items():
        given = columns(mechanism, program, STATES)
        ours, numpys = (program.arrays(*given, by_math=flag) for flag in (True, False))
        for x, y in zip(leaves(ours), leaves(numpys), strict=True):
            assert np.abs(x - y).max() <= 4 * math.ulp(np.abs(x).max()), kind


# ---------------------------------------------------------------- 6: a program can be read


@each
def test_there_is_one_statement_a_line_and_one_value_for_a_name(name):
    for program in programs_of(MECHANISMS[name]).values():
        before, (inner,) = parts(program)
        *within, last = inner.body
        rows = [part.lineno for part in (*before, inner, *inner.body)]
        assert len(set(rows)) == len(rows)
        assert all(part.lineno == part.end_lineno for part in (*before, *inner.body))
        known = set(inputs(program))
        for part in (*before, *within):
            if isinstance(part, ast.Assign):
                (target,) = part.targets
                assert target.id not in known
                known.add(target.id)
            else:
                assert isinstance(part, ast.If), ast.unparse(part)
                assert len(part.body) == 1
        assert isinstance(last, ast.Return)


@each
def test_what_nothing_reads_falls_out_and_equal_terms_are_shared(name):
    for program in programs_of(MECHANISMS[name]).values():
        before, (inner,) = parts(program)
        nodes = [node for part in (*before, *inner.body) for node in ast.walk(part)]
        names = [node for node in nodes if isinstance(node, ast.Name)]
        written = {node.id for node in names if isinstance(node.ctx, ast.Store)}
        assert written <= {node.id for node in names if isinstance(node.ctx, ast.Load)}
        # A refusal may stand in more than one guard.
        terms = [term for term in operations(program) if not term.startswith(('new(', 'k_'))]
        assert terms
        assert len(set(terms)) == len(terms)


def test_names_are_those_of_the_formulas():
    source = Solver(MECHANISMS['crank-rocker']).source
    for name in ('half', 'sin_h', 'cos_h', 'sin_m', 'cos_m', 'mean', 'turn', 'bend', 'square'):
        assert f'        {name} = ' in source
    assert source == Solver(MECHANISMS['crank-rocker']).source
    assert len(inputs(programs_of(MECHANISMS['crank-rocker'])['state 1'])) == 3
    assert len(inputs(programs_of(PUMP)['state 1'])) == 6


def frames(error):
    """The frames of an error's traceback that lie in programs."""
    found = traceback.extract_tb(error.__traceback__)
    return [frame for frame in found if frame.filename.startswith('<')]


def test_tracebacks_show_the_programs_line():
    solver = Solver(MECHANISMS['crank-rocker'])
    with pytest.raises(ConfigurationError) as raised:
        solver.state(math.nan, 1.0, 2.0)
    (frame,) = frames(raised.value)
    assert frame.name == 'state'
    assert frame.line == solver.source.splitlines()[frame.lineno - 1].strip()
    assert frame.line.startswith('if not')
    with pytest.raises(ConfigurationError) as raised:
        solver.state(np.array([math.nan]), 1.0, 2.0)
    (frame,) = frames(raised.value)
    assert 'nan' not in frame.line  # its text, not its values


def with_table(constants, x):
    table, factor = constants
    height = table(x * factor)
    return height + sin(height), where(height > 1, height, 1.0)


def test_a_traceback_out_of_an_opaque_function_passes_a_line_that_is_shown():
    def broken(_):
        raise RuntimeError('the table is broken')

    program = Program(with_table, (Opaque(broken), 2.0), ('x',))
    for call in (lambda: program.scalar(1.0), lambda: program.arrays(np.array([1.0]))):
        with pytest.raises(RuntimeError, match='the table is broken') as raised:
            call()
        words = ''.join(traceback.format_exception(raised.value))
        (frame,) = frames(raised.value)
        assert frame.line.startswith('height = ')
        assert frame.line in words
        assert 'in with_table' in words


def test_a_structure_is_compiled_once_and_numbers_are_bound():
    lengths = (1, 3, 2.5, 2.2), (2, 7, 9, 6)
    one, other = (Solver(four_bar(each, 0.3, 'open', HEAVY)) for each in lengths)
    third = Solver(MECHANISMS['massless'])
    codes = [programs_of(x.mechanism)['state 0'].scalar.__code__ for x in (one, other, third)]
    assert codes[0].co_name == 'state'
    assert codes[0] is codes[1]
    assert codes[0] is not codes[2]
    assert one.state(0.3, 1.0) != other.state(0.3, 1.0)


@each
def test_solvers_pickle_by_description(name):
    solver = Solver(MECHANISMS[name])
    q = inside(solver.mechanism)
    u = (1.0,) * len(q)
    before = solver.state(q, u, u)  # pickles after its programs were made too
    text = pickle.dumps(solver)
    twin = pickle.loads(text)
    assert twin.mechanism == solver.mechanism
    assert bits(twin.state(q, u, u)) == bits(before)
    assert len(text) < len(pickle.dumps(solver.mechanism)) + 100


def test_results_are_not_written_over_by_the_next_call():
    solver, cranks = Solver(MECHANISMS['crank-rocker']), np.linspace(0, 6, 1000)
    first = solver.state(cranks, 2.0)
    kept = [x.copy() for x in leaves(first) if isinstance(x, np.ndarray)]
    solver.state(cranks + 1, -3.0)
    again = [x for x in leaves(first) if isinstance(x, np.ndarray)]
    assert all(map(np.array_equal, kept, again))


def nested(constants, x):
    inner, factor = constants
    root = sqrt(x * factor)
    shifted = inner(x + 1)
    return root * 2 + shifted, root


def test_a_program_that_runs_within_itself_has_its_own_buffers():
    """What threads do by chance happens here every time: a call within a call."""
    depth = []

    def inner(x):
        if len(depth) == 3:
            return 0.0 * x
        depth.append(x)
        found = program.arrays(x)[0]
        depth.pop()
        return found

    program = Program(nested, (Opaque(inner), 3.0), ('x',))
    xs = np.linspace(1, 2, 100)
    summed, root = program.arrays(xs)
    roots = [np.sqrt((xs + i) * 3.0) * 2 for i in range(4)]
    assert np.allclose(summed, sum(roots), rtol=1e-14)
    assert np.array_equal(root, np.sqrt(xs * 3.0))


def with_identity(same, x):
    y = x * 2
    z = same(y)
    w = y + 1
    return w * 3 + z, z - w


def test_an_opaque_function_may_return_what_it_was_given():
    """Whose place must not be taken by what is computed next."""
    program, xs = Program(with_identity, Opaque(lambda x: x), ('x',)), np.linspace(1, 2, 10)
    for by_math in (False, True):
        found = program.arrays(xs, by_math=by_math)
        assert list(zip(*(x.tolist() for x in found), strict=True)) == [
            program.untraced(x) for x in xs.tolist()
        ]


@pytest.mark.parametrize('shape', [(0,), (3, 0), (2, 3), (1, 1)])
def test_arrays_keep_their_shape(shape):
    state = Solver(MECHANISMS['crank-rocker']).state(np.ones(shape), 2.0)
    assert {np.shape(x) for x in leaves(state)} == {shape}


def test_threads_do_not_share_buffers():
    solver = Solver(MECHANISMS['crank-rocker'])
    cranks = [np.linspace(i, i + 6, 30_000) for i in range(6)]
    alone = [solver.state(crank, 2.0, 1.0) for crank in cranks]
    wrong, start = [], threading.Barrier(len(cranks))

    def work(i):
        start.wait()
        for _ in range(10):
            found = solver.state(cranks[i], 2.0, 1.0)
            pairs = zip(leaves(found), leaves(alone[i]), strict=True)
            wrong.extend(i for x, y in pairs if not np.array_equal(x, y))

    threads = [threading.Thread(target=work, args=(i,)) for i in range(len(cranks))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


# ---------------------------------------------------------------- 7: opaque functions, loops

AT, HEIGHT = [0.0, 1.0, 2.5, 4.0], [0.3, 1.7, -0.4, 2.0]


def lookup(x):
    return np.interp(x, AT, HEIGHT)


def test_a_table_works_in_all_forms():
    program = Program(with_table, (Opaque(lookup), 0.8), ('x',))
    xs = np.linspace(-1, 6, 1001)
    one_by_one = [program.scalar(x) for x in xs.tolist()]
    for x, found in zip(xs.tolist(), one_by_one, strict=True):
        assert bits(found) == bits(program.untraced(x))
        height = float(np.interp(x * 0.8, AT, HEIGHT))
        assert found == (height + math.sin(height), max(height, 1.0))
    exact = program.arrays(xs, by_math=True)
    assert bits(tuple(exact[0].tolist())) == bits(tuple(x for x, _ in one_by_one))
    assert np.allclose(program.arrays(xs)[0], exact[0], rtol=1e-15, atol=1e-15)
    assert np.array_equal(program.arrays(xs)[1], exact[1])


def test_another_table_is_another_constant_and_no_other_structure():
    one, other = (
        Program(with_table, (Opaque(f), 0.8), ('x',)) for f in (lookup, lambda x: 2.0 * x)
    )
    assert one.scalar.__code__ is other.scalar.__code__
    assert one.scalar(1.0) != other.scalar(1.0)


class Table(NamedTuple):
    """A load of a stranger: torque on a link, from a table over its angle."""

    table: Opaque

    def forces(self, links, rates):
        del rates
        return {2: self.table(links[2].position)}

    def resistance(self, rates):
        del rates
        return {}

    def potential(self, links):
        del links


@dataclass(frozen=True)
class Measured(FourBar):
    """A four-bar with a measured torque on its rocker."""

    def loads(self):
        return (Table(Opaque(lookup)),)


def test_a_load_of_a_stranger_may_read_a_table():
    free, held = (four_bar(LENGTHS['crank-rocker'], 0, 'open', HEAVY, cls=c)
                  for c in (FourBar, Measured))  # fmt: skip
    free, held = Solver(free), Solver(held)
    cranks = np.linspace(-4, 9, 300)
    torque = held.state(cranks, 2.0).torque
    for crank, found in zip(cranks.tolist(), torque.tolist(), strict=True):
        state = free.state(crank, 2.0)
        works = lookup(state.position[2]) * state.velocity[2] / 2.0
        assert held.state(crank, 2.0).torque == pytest.approx(state.torque - works, rel=1e-12)
        assert found == pytest.approx(state.torque - works, rel=1e-12)


def series(factors, x):
    angles = [x * n for n in range(1, len(factors) + 1)]
    return total(f * cos(angle) for f, angle in zip(factors, angles, strict=True))


def test_a_sum_may_be_long():
    """Such as of harmonics: Python nests 200 parentheses at most."""
    program = Program(series, tuple(1.0 / n for n in range(1, 401)), ('x',))
    assert bits(program.scalar(0.7)) == bits(program.untraced(0.7))
    assert bits(first_of(program.arrays(np.array([0.7]), by_math=True))) == bits(
        program.untraced(0.7)
    )


def halved(_, x, target):
    return x - (x * x - target) / (2 * x)


def test_a_program_may_be_called_in_a_loop():
    """A fixed point, as of friction: scalar and array have the same bits after each round."""
    program, targets = Program(halved, (), ('x', 'target')), np.linspace(1, 9, 200)
    x, xs = [1.0] * len(targets), np.ones(len(targets))
    for _ in range(8):
        x = [program.scalar(*pair) for pair in zip(x, targets.tolist(), strict=True)]
        xs = program.arrays(xs, targets)
        assert bits(tuple(x)) == bits(tuple(xs.tolist()))
    assert np.allclose(xs, np.sqrt(targets), rtol=1e-15)


# ---------------------------------------------------------------- 8: a compiler only where asked

NO_COMPILER = """
import sys
import linkage_ros.record, linkage_ros.replay, linkage_ros.log_tool, linkage_ros.chart_tool
import linkage_ros.verification.verify, linkage_ros.run.machine
from linkage_ros import Solver
from linkage_ros.parameters.configuration import load
Solver(load('quadrilateral').mechanism).state(0.3, 1.0)
sys.argv[1] and __import__(sys.argv[1])
print(sorted({name.partition('.')[0] for name in sys.modules} & {'numba', 'llvmlite', 'decimal'}))
"""


def loaded(also):
    done = subprocess.run(
        [sys.executable, '-c', NO_COMPILER, also], cwd=ROOT, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return ast.literal_eval(done.stdout)


def test_no_compiler_is_loaded_where_none_is_asked_for():
    assert not {'numba', 'llvmlite'} & set(loaded(''))
    assert 'decimal' in loaded('decimal')  # what is loaded would be seen


def test_every_form_of_a_program_has_the_same_signs():
    """Operators of recording numbers are those of floats, forward and backward."""
    for sign in (operator.add, operator.sub, operator.mul, operator.truediv):

        def formula(_, x, y, sign=sign):
            return sign(x, y), sign(2.0, x), sign(x, 2), -x, abs(x), atan2(x, y), cos(x)

        formula.__name__ = f'formula_{sign.__name__}'
        program = Program(formula, (), ('x', 'y'))
        for x, y in itertools.product((1.5, -2.25, 1e-3), repeat=2):
            assert bits(program.scalar(x, y)) == bits(formula(None, x, y))
            row = program.arrays(np.array([x]), np.array([y]), by_math=True)
            assert bits(first_of(row)) == bits(formula(None, x, y))
