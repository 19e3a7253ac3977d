# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart sketch: names, directions and lengths of what a parameter file means."""

import itertools
import json
import math

import numpy as np
import pytest
from matplotlib.figure import Figure

from linkage_lab import command_line
from linkage_lab.charts import sketch
from linkage_lab.charts.sketch import _bars, _pins, _zero, describe, draw_sketch, sketch_of
from linkage_lab.output import in_degrees, rounded
from linkage_lab.period import law_period
from linkage_ros import ConfigurationError, Solver
from linkage_ros.internals import UNITS
from linkage_ros.settings.configuration import configure, load
from linkage_ros.settings.presets import preset_names

# Theo Jansen's leg, with its published lengths, mm.
JANSEN = {
    'mechanism': 'drawing', 'rpm': 60.0, 'drawing.units': 'mm', 'drawing.input': 'crank',
    'drawing.frame': ['O', 'Z'],
    'drawing.pins.O': [0.0, 0.0], 'drawing.pins.Z': [-38.0, -7.8],
    'drawing.pins.M': [5.1303, 14.0954], 'drawing.pins.B': [-40.9094, 33.5979],
    'drawing.pins.C': [-19.7279, -42.5940], 'drawing.pins.D': [-78.0995, -8.0018],
    'drawing.pins.E': [-56.3878, -40.8798], 'drawing.pins.F': [-14.2496, -91.2867],
    'drawing.links.crank.pins': ['O', 'M'], 'drawing.links.j.pins': ['M', 'B'],
    'drawing.links.bde.pins': ['Z', 'B', 'D'], 'drawing.links.k.pins': ['M', 'C'],
    'drawing.links.c.pins': ['Z', 'C'], 'drawing.links.f.pins': ['D', 'E'],
    'drawing.links.ghi.pins': ['C', 'E', 'F'],
    'loads.ground.kind': 'force', 'loads.ground.pin': 'F', 'loads.ground.force': [0.0, 20.0],
}  # fmt: skip
# Joseph Klann's leg, with the lengths of its patent, mm; two of its links are narrow triangles.
KLANN = {
    'mechanism': 'drawing', 'rpm': 60.0, 'drawing.units': 'mm', 'drawing.input': 'crank',
    'drawing.frame': ['O', 'U', 'W'],
    'drawing.pins.O': [0.0, 0.0], 'drawing.pins.U': [-23.3, 61.6],
    'drawing.pins.W': [-59.0, -17.6], 'drawing.pins.M': [0.0, 26.8],
    'drawing.pins.elbow': [-57.698, 14.4736], 'drawing.pins.knee': [-105.0273, -7.5441],
    'drawing.pins.hip': [-72.9884, 76.239], 'drawing.pins.foot': [-90.5512, -96.0683],
    'drawing.links.crank.pins': ['O', 'M'], 'drawing.links.arm.pins': ['M', 'elbow', 'knee'],
    'drawing.links.lower_rocker.pins': ['W', 'elbow'],
    'drawing.links.upper_rocker.pins': ['U', 'hip'],
    'drawing.links.leg.pins': ['hip', 'knee', 'foot'],
}  # fmt: skip
LENGTHS = '15', '50', '41.5', '39.3', '40.1', '55.8', '39.4', '36.7', '65.7', '49', '61.9'
GAS = {
    'mechanism': 'drawing', 'rpm': 60.0, 'drawing.units': 'mm', 'drawing.input': 'crank',
    'drawing.frame': ['O', 'Q', 'G'],
    'drawing.pins.O': [10.0, 0.0], 'drawing.pins.A': [40.0, 40.0],
    'drawing.pins.B': [130.0, 90.0], 'drawing.pins.Q': [150.0, 0.0],
    'drawing.pins.P': [90.0, 120.0], 'drawing.pins.S': [270.0, 120.0],
    'drawing.pins.G': [210.0, -20.0],
    'drawing.links.crank.pins': ['O', 'A'], 'drawing.links.coupler.pins': ['A', 'B', 'P'],
    'drawing.links.rocker.pins': ['B', 'Q'], 'drawing.links.conrod.pins': ['B', 'S'],
    'drawing.slides.ram.pin': 'S', 'drawing.slides.ram.direction': [1.0, 0.0],
    'drawing.cylinders.gas.from': 'G', 'drawing.cylinders.gas.to': 'P',
}  # fmt: skip
SPRING = GAS | {
    'loads.strut.kind': 'spring', 'loads.strut.cylinder': 'gas', 'loads.strut.stiffness': 1e3,
    'loads.strut.free_length': 0.2, 'loads.push.kind': 'link', 'loads.push.link': 'ram',
    'loads.push.force': -50.0,
}  # fmt: skip
# A crank that cannot turn fully; its arc, in degrees from 0, contains the drawn angle plus a turn.
LIMITED = {
    'mechanism': 'drawing', 'drawing.input': 'arm', 'drawing.frame': ['O', 'Q'],
    'drawing.pins.O': [0.0, 0.0], 'drawing.pins.A': [0.05, 0.08],
    'drawing.pins.B': [0.35, 0.13], 'drawing.pins.Q': [0.4, 0.0],
    'drawing.links.arm.pins': ['O', 'A'], 'drawing.links.arm.mass': 1.0,
    'drawing.links.arm.center': [0.0, 0.0], 'drawing.links.arm.inertia': 1.0,
    'drawing.links.rod.pins': ['A', 'B'],
    'drawing.links.out.pins': ['B', 'Q'],
}  # fmt: skip
# Two of its fixed pins are near to each other.
TIPPER = {
    'mechanism': 'drawing', 'drive': 'motion', 'motion.center': '153deg',
    'motion.amplitude': '22deg', 'motion.frequency': 0.02, 'drawing.input': 'body',
    'drawing.frame': ['H', 'D', 'G'], 'drawing.pins.H': [0.0, 0.0],
    'drawing.pins.D': [-1.0, -0.35], 'drawing.pins.G': [-0.9, -0.2],
    'drawing.pins.A': [-2.2, 0.15], 'drawing.pins.B': [-2.75, 0.05],
    'drawing.pins.C': [-2.9, -0.25], 'drawing.pins.front': [-4.2, 0.2],
    'drawing.links.body.pins': ['H', 'A', 'front'], 'drawing.links.triangle.pins': ['A', 'B', 'C'],
    'drawing.links.tie.pins': ['C', 'D'], 'drawing.cylinders.hoist.from': 'G',
    'drawing.cylinders.hoist.to': 'B',
}  # fmt: skip
LAW = {'drive': 'motion', 'motion.center': '417deg', 'motion.amplitude': 0.1,
       'motion.frequency': 1.0}  # fmt: skip


def design_of(source):
    return load(source) if isinstance(source, str) else configure(source)


def written(design, at=None):
    """Returns the texts of the drawing with dimensions, and their boxes."""
    axes = Figure(figsize=(10.0, 7.0), dpi=140).add_axes((0.02, 0.02, 0.96, 0.96))
    draw_sketch(axes, sketch_of(design.only, at), with_dimensions=True, with_centers=True)
    texts = [text for text in axes.texts if text.get_text()]
    return [x.get_text() for x in texts], [x.get_window_extent() for x in texts]


@pytest.mark.parametrize('source', [*preset_names(), JANSEN, GAS, SPRING])
def test_every_name_is_in_the_drawing_and_in_words(source):
    design = design_of(source)
    texts, boxes = written(design)
    structure = design.mechanism.structure()
    lines = [*describe(sketch_of(design.only))]
    for link in structure.links:
        assert link.name in texts
        assert any(line.startswith(f'{link.name}: ') for line in lines)
    for name in structure.traced:
        assert name in texts
        assert any(line.startswith(f'point {name} of ') for line in lines)
    for one in design.mechanism.loads:
        assert any(line.startswith(f'load {one.name}: ') for line in lines)
    assert len({*texts} & {*structure.points}) == len([x for x in texts if x in structure.points])
    for (one, box), (other, second) in itertools.combinations(zip(texts, boxes, strict=True), 2):
        assert not box.overlaps(second), (one, other)


@pytest.mark.parametrize('source', [*preset_names(), JANSEN, GAS, SPRING, KLANN])
def test_each_fixed_pin_has_a_ground_symbol(source):
    design = design_of(source)
    axes = Figure(figsize=(10.0, 7.0), dpi=140).add_axes((0.02, 0.02, 0.96, 0.96))
    draw_sketch(axes, sketch_of(design.only), with_dimensions=False, with_centers=False)
    drawing = getattr(design.only.drawn_mechanism, 'drawing', None)
    pins = design.mechanism.structure().points
    places = {name: at.fixed for name, at in pins.items() if not any(at.weights)}
    if drawing is not None:
        unit, origin = float(UNITS[drawing.units]), complex(*drawing.pins[next(iter(pins))])
        places |= {x: (complex(*drawing.pins[x]) - origin) * unit for x in drawing.frame}
    lines = [line.get_xydata() @ (1, 1j) for line in axes.lines]
    triangles = [line[0] for line in lines if len(line) == 4 and line[0] == line[3]]
    for name, place in places.items():
        assert any(abs(corner - place) < 1e-9 for corner in triangles), name


@pytest.mark.parametrize('source', [JANSEN, GAS, SPRING, KLANN])
def test_fixed_pins_have_their_distances_from_the_first(source):
    texts, _ = written(configure(source))
    unit, (first, *others) = source['drawing.units'], source['drawing.frame']
    for pin in others:
        apart = math.dist(source[f'drawing.pins.{first}'], source[f'drawing.pins.{pin}'])
        assert f'{apart:.4g}' in texts, (pin, unit)


@pytest.mark.parametrize('source', [*preset_names(), JANSEN, GAS, SPRING, KLANN])
def test_marks_cover_no_pin(source):
    sketched = sketch_of(design_of(source).only)
    pins, near = _pins(sketched)
    axes = Figure(figsize=(10.0, 7.0), dpi=140).add_axes((0.02, 0.02, 0.96, 0.96))
    draw_sketch(axes, sketched, with_dimensions=False, with_centers=True)
    arrows = [x.xy for x in axes.texts if not x.get_text() and x.arrowprops['color'] != 'black']
    for x, y in arrows[: len(sketched.drawing.turning)]:
        assert abs(pins - complex(x, y)).min() > 0.3 * near


def test_path_along_a_law_is_that_of_the_motion():
    design = configure(LIMITED | LAW).only
    path = sketch_of(design).path
    motion = law_period(Solver(design.mechanism), design.drive).rows('position')
    for limit in (np.min, np.max):
        assert limit(path, axis=0) == pytest.approx(limit(motion, axis=0), abs=1e-4)
    assert sketch_of(configure(LIMITED | {'drive': 'follow'}).only).path is None


@pytest.mark.parametrize('at', [None, 0.9])
def test_centre_of_mass_is_marked_where_the_words_have_it(at):
    coupler = {'mass': 2.0, 'inertia': 1.0, 'center': [60.0, 95.0]}
    given = GAS | {f'drawing.links.coupler.{name}': value for name, value in coupler.items()}
    given['drawing.slides.ram.mass'] = 1.0
    sketched = sketch_of(configure(given).only, at)
    axes = Figure(figsize=(10.0, 7.0), dpi=140).add_axes((0.02, 0.02, 0.96, 0.96))
    draw_sketch(axes, sketched, with_dimensions=False, with_centers=True)
    marks = [x.get_xydata()[0] for x in axes.lines if x.get_marker() is sketch._QUARTERS]
    (mark,) = marks  # that of the ram is at its pin
    (words,) = (x for x in describe(sketched) if x.startswith('coupler: '))
    assert f'mass 2 kg at {sketched.at(complex(*mark))}' in words
    if at is None:
        assert mark == pytest.approx((0.05, 0.095))  # as drawn, from O


@pytest.mark.parametrize('source', [*preset_names(), JANSEN, GAS, SPRING, KLANN, TIPPER])
@pytest.mark.parametrize('size', [(10.0, 7.0), (4.0, 3.3)])
def test_each_pins_name_is_nearest_to_its_pin(source, size):
    axes = Figure(figsize=size, dpi=140).add_axes((0.02, 0.02, 0.96, 0.96))
    sketched = sketch_of(design_of(source).only)
    draw_sketch(axes, sketched, with_dimensions=False, with_centers=False)
    drawing = sketched.drawing
    names = dict(zip(drawing.pins, drawing.place(sketched.positions)[0], strict=True))
    names |= zip(drawing.pivot_names, drawing.pivots, strict=True)
    names.pop(drawing.unnamed, None)
    places = axes.transData.transform([*names.values()])
    texts = {text.get_text(): text for text in axes.texts}
    for name, own in zip(names, places, strict=True):
        low, high = texts[name].get_window_extent().get_points()
        apart = np.linalg.norm(np.clip(places, low, high) - places, axis=1)
        assert math.dist(np.clip(own, low, high), own) <= apart.min() + 2.0, name


def test_lengths_of_jansens_leg_are_the_published_ones():
    texts, _ = written(configure(JANSEN))
    assert {*LENGTHS} <= {*texts}
    assert 'ground 20 N' in texts
    (title, *_) = describe(sketch_of(configure(JANSEN).only))
    assert title.startswith('eight-bar (four_bar + 2 dyads): ')


@pytest.mark.parametrize('source', [JANSEN, GAS, KLANN, 'shaper'])
def test_each_bar_is_in_the_words_and_has_at_most_one_dimension(source):
    sketched = sketch_of(design_of(source).only)
    texts, _ = written(design_of(source))
    words = {line.partition(': ')[0]: line for line in describe(sketched)}
    for link in sketched.drawing.turning:
        for bar in _bars(sketched, link):
            assert f' {sketched.length(bar.length)}' in words[link]
            shown = sketched.length(bar.length, 4)
            bars = [bar for one in sketched.drawing.turning for bar in _bars(sketched, one)]
            assert texts.count(shown) <= sum(sketched.length(x.length, 4) == shown for x in bars)


def test_pins_on_a_bar_divide_its_dimension():
    bar = {**GAS, 'drawing.pins.P': [85.0, 65.0]}  # the middle of A and B
    sketched = sketch_of(configure(bar).only)
    assert {bar.name for bar in _bars(sketched, 'coupler')} == {'A to P', 'P to B'}


def test_a_dimension_without_room_at_its_bar_is_left_to_the_words(monkeypatch):
    dimensions = {'59', '52.2', '110.5', '173.2'}
    monkeypatch.setattr(sketch, '_NEAR_BAR', math.inf)
    assert dimensions <= {*written(configure(KLANN))[0]}
    monkeypatch.setattr(sketch, '_NEAR_BAR', 1.0)
    assert not dimensions & {*written(configure(KLANN))[0]}
    words = ' '.join(describe(sketch_of(configure(KLANN).only)))
    assert all(f' {x}' in words for x in dimensions)
    assert 'knee to M 110.5' in words


@pytest.mark.parametrize(
    ('load', 'words'),
    [
        ({'kind': 'force', 'pin': 'S', 'force': [1.0, 0.0]}, 'force on conrod at pin S, force'),
        ({'kind': 'force', 'pin': 'S', 'link': 'ram', 'force': [1.0, 0.0]},
         'force on ram at pin S, force [1, 0]'),
        ({'kind': 'force', 'link': 'ram', 'at': [270.0, 120.0], 'force': [1.0, 0.0]},
         'force on ram, force [1, 0], at [270, 120]'),
        ({'kind': 'spring', 'cylinder': 'gas', 'stiffness': 10.0},
         'spring on coupler and frame, stiffness 10, cylinder gas'),
        ({'kind': 'link', 'link': 'ram', 'force': 1.0}, 'link, link ram, force 1'),
    ],
)  # fmt: skip
def test_a_load_is_described_with_its_links(load, words):
    given = {f'loads.x.{name}': value for name, value in load.items()}
    lines = [*describe(sketch_of(configure(GAS | given).only))]
    assert [line for line in lines if line.startswith(f'load x: {words}')], lines


def test_pin_that_joins_three_links_has_one_name():
    texts, _ = written(configure(GAS))
    assert 'B' in texts
    assert 'B_conrod' not in texts


@pytest.mark.parametrize(('source', 'name'), [(GAS, 'gas'), (SPRING, 'gas (strut)')])
def test_cylinder_is_a_line_with_its_length_as_drawn(source, name):
    design = configure(source)
    (line,) = (x for x in describe(sketch_of(design.only)) if x.startswith(f'line {name}: '))
    assert line.endswith(f'length {math.hypot(120.0, 140.0):.5g}')
    assert '(200, -20)' in line
    assert 'G' in written(design)[0]
    assert name in written(design)[0]


@pytest.mark.parametrize('source', ['shaper', 'compressor', 'watt', SPRING])
def test_zero_of_a_slide_on_the_frame_does_not_move(source):
    design = design_of(source)
    for j, link in enumerate(design.mechanism.structure().links):
        if link.is_guided:
            places = [_zero(sketch_of(design.only, at), j) for at in (0.3, 1.1, 2.9)]
            assert places == pytest.approx(places[:1] * 3, abs=1e-12)


def test_command_writes_what_it_prints(tmp_path, called):
    words = 'shaper', '--at', '85deg', '--out', tmp_path, '--format', 'svg,png'
    code, out, _ = called(command_line, 'sketch', *words)
    assert code == 0
    assert 'crank 85 deg' in out
    assert {x.name for x in tmp_path.iterdir()} == {'shaper_sketch.svg', 'shaper_sketch.png'}


@pytest.mark.parametrize('drive', [{'drive': 'follow'}, {'drive': 'torque'}, LAW])
def test_limited_crank_is_shown_as_drawn(drive):
    design = configure(LIMITED | drive)
    sketched = sketch_of(design.only)
    assert not sketched.solver.reach.arcs[0][0] < sketched.place < sketched.solver.reach.arcs[0][1]
    at = sketched.point(sketched.solver.structure.points['A'])
    assert (at.real, at.imag) == pytest.approx((0.05, 0.08))
    assert any(line.startswith('as drawn at ') for line in describe(sketched))


@pytest.mark.parametrize('command', ['sketch', 'state'])
def test_crank_that_cannot_turn_is_shown_with_a_note(tmp_path, monkeypatch, called, command):
    values = LIMITED | {'rpm': 60.0, 'loads.push.kind': 'force', 'loads.push.pin': 'B',
                        'loads.push.force': [1.0, 0.0]}  # fmt: skip
    path = tmp_path / 'limited.yaml'
    path.write_text(json.dumps({'/**': {'ros__parameters': values}}))
    monkeypatch.chdir(tmp_path)
    code, out, err = called(command_line, command, path)
    assert code == 0
    assert 'arm' in out
    assert 'note: ' in err
    with pytest.raises(ConfigurationError, match='cannot turn fully'):
        load(str(path))


@pytest.mark.parametrize('unit', ['m', 'cm', 'mm', 'in'])
def test_lengths_are_in_the_unit_of_the_drawing(unit):
    sketched = sketch_of(configure(LIMITED | {'drive': 'follow', 'drawing.units': unit}).only)
    lines = [*describe(sketched)]
    (frame,) = (line for line in lines if line.startswith('frame: '))
    assert frame.endswith('Q (0.4, 0)')
    assert any(f'lengths in {unit},' in line for line in lines)
    number, its_unit = sketched.drawing.scale_label.split()
    assert its_unit == unit
    assert number in {'0.05', '0.1', '0.2'}
    start, end = sketched.drawing.scale[1:3]
    assert math.dist(start, end) / float(UNITS[unit]) == pytest.approx(float(number))


@pytest.mark.parametrize('angle', [-1e-17, -0.0, math.radians(180.0)])
def test_a_rounding_error_of_zero_has_no_sign(angle):
    assert in_degrees(angle) in {'0 deg', '180 deg'}
    assert rounded(-0.0) == '0'
