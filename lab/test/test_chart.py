# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion: compares the table with the solver, and inspects the picture."""

import csv
import io
import itertools
import json
import math
import os
import re
import sys
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from mechanisms import FOLLOWED, SEVERAL_FORCES
from pages import block, read
from PIL import Image, ImageSequence
from ros_harness import assert_refused
from scipy.integrate import cumulative_trapezoid, trapezoid

from linkage_lab import command_line, export
from linkage_lab.charts import accuracy, movie, sketch
from linkage_lab.charts.linkage_picture import LinkagePicture
from linkage_lab.charts.motion import DESIGN_COLORS, _driven_by_loads
from linkage_lab.command_line import QUANTITIES
from linkage_lab.period import (
    SLIDING,
    TURNING,
    extent,
    mean,
    period_to_show,
    settled_period,
    speed_driven_period,
)
from linkage_lab.pump.analysis import settle
from linkage_ros import Body, Coupler, Dyad, FourBar, Frame, Solver
from linkage_ros.mechanism.travel import travel
from linkage_ros.motion.drives.follow import FollowDrive
from linkage_ros.settings.configuration import load
from linkage_ros.settings.presets import preset_names

# A coupler point, a guide and a load curve run at a given speed; a wind pump runs at the speed at
# which it settles.
PRESETS = ['coupler_point', 'slider_crank', 'compressor']
ALL = [*PRESETS, 'wind_pump']
CHANGE_POINT = """
linkage_node:
  ros__parameters:
    mechanism: four_bar
    rpm: 60.0
    frame: {length: 2.0}
    crank: {length: 1.0}
    coupler: {length: 3.0, mass: 1.0, center: [1.5, 0.2]}
    rocker: {length: 2.0}
"""


def table(path):
    with path.open(newline='') as stream:
        names, *rows = csv.reader(stream)
    values = np.array(rows, float).T
    return dict(zip(names, values, strict=True))


def elapsed(crank, rate):
    """Returns the time at which each crank angle is passed."""
    return cumulative_trapezoid(1 / rate, crank, initial=0.0)


@pytest.fixture(scope='module')
def drawn(tmp_path_factory):
    """Output, table and picture of each preset with all options; a wind pump is settled."""
    folder, charts, save = tmp_path_factory.mktemp('charts'), {}, Figure.savefig
    for preset in ALL:
        options = ['--rpm', 90, '--acceleration', 2.5, '--reactions'] if preset in PRESETS else []
        pages, said = [], io.StringIO()
        with pytest.MonkeyPatch.context() as patch, redirect_stdout(said):
            patch.setattr(
                Figure, 'savefig',
                lambda page, path, to=pages, **meta: to.append(page) or save(page, path, **meta),
            )  # fmt: skip
            words = ['motion', preset, *options, '--show', *QUANTITIES, '--out', folder]
            patch.setattr(sys, 'argv', ['linkage_chart', *map(str, words)])
            assert command_line.main() == 0
        *said, picture, written = said.getvalue().splitlines()
        charts[preset] = SimpleNamespace(
            said=said, columns=table(Path(written)), page=pages[0],
            pixels=matplotlib.image.imread(picture)[..., :3],
        )  # fmt: skip
    return charts


@pytest.mark.parametrize('preset', PRESETS)
def test_csv_equals_solver_to_the_last_bit(drawn, preset):
    columns = drawn[preset].columns
    solver = Solver(load(preset).mechanism)
    crank = columns['crank_angle [rad]']
    assert (crank[0], crank[-1]) == (0.0, 2 * math.pi)
    assert (len(crank) == 721) == (solver.mechanism.loads == ())  # curves have corners
    state = solver.state(crank, 3 * math.pi, 2.5)
    assert np.array_equal(columns['driving_torque [N m]'], state.torque)
    assert np.array_equal(columns['driving_power [W]'], state.torque * (3 * math.pi))
    for link, name in enumerate(solver.links):
        names = SLIDING if name == 'slider' else TURNING
        place, rate, change = (columns[f'{name}.{word} [{unit}]'] for word, unit in names)
        turned = place - state.position[link]
        assert np.allclose(turned, 2 * math.pi * np.rint(turned / (2 * math.pi)), atol=1e-14)
        assert np.array_equal(rate, state.velocity[link])
        assert np.array_equal(change, state.acceleration[link])
    reactions = solver.reactions(state)
    for pin, force in reactions.pins.items():
        for axis, values in zip('xy', force, strict=True):
            assert np.array_equal(columns[f'pin_{pin}.{axis} [N]'], values)
    assert np.array_equal(columns['shaking_moment [N m]'], reactions.shaking_moment)
    assert ('slider.guide_force [N]' in columns) == bool(reactions.guides)
    for name in solver.structure.traced:
        for (quantity, unit), vector in zip(SLIDING, solver.point(state, name), strict=True):
            for axis, values in zip('xy', vector, strict=True):
                assert np.array_equal(columns[f'{name}.{quantity}.{axis} [{unit}]'], values)


@pytest.mark.parametrize('preset', ['coupler_point', 'slider_crank'])
@pytest.mark.parametrize('step', [90.0, 0.7])
def test_table_with_steps_equals_solver_in_degrees(tmp_path, called, undrawn, preset, step):
    options = '--csv', step, '--rpm', 90, '--acceleration', 2.5, '--reactions'
    assert called(command_line, 'motion', preset, *options, '--out', tmp_path)[0] == 0
    columns = table(tmp_path / f'{preset}_motion.csv')
    degrees, solver = columns['crank_angle [deg]'], Solver(load(preset).mechanism)
    assert [round(x, 9) for x in degrees] == [round(step * n, 9) for n in range(len(degrees))]
    assert 360 - step < degrees[-1] <= 360
    state = solver.state(np.radians(degrees), 3 * math.pi, 2.5)
    assert columns['driving_torque [N m]'] == pytest.approx(state.torque, rel=1e-11)
    assert columns['coupler.angular_velocity [rad/s]'] == pytest.approx(
        state.velocity[1], rel=1e-11
    )
    turned = np.radians(columns['coupler.direction [deg]']) - state.position[1]
    assert np.allclose(turned, math.tau * np.rint(turned / math.tau), atol=1e-11)
    for pin in ('A', 'B'):
        for axis, values in zip('xy', solver.point(state, pin).position, strict=True):
            assert columns[f'{pin}.{axis} [m]'] == pytest.approx(values, rel=1e-11, abs=1e-12)
    assert columns['shaking_moment [N m]'] == pytest.approx(solver.reactions(state).shaking_moment)


@pytest.mark.parametrize('preset', ALL)
def test_nothing_is_cut_off_at_the_edges(drawn, preset):
    pixels = drawn[preset].pixels
    edges = pixels[:3], pixels[-3:], pixels[:, :3], pixels[:, -3:]
    assert all((edge == 1.0).all() for edge in edges)
    # Curves in the crank's colour, on white.
    assert (np.abs(pixels[::4] * 255 - (213, 94, 0)).max(axis=-1) < 2).sum() > 100


@pytest.mark.parametrize('preset', ALL)
def test_peaks_are_written_next_to_the_curve(drawn, preset):
    columns = drawn[preset].columns
    found = extent(columns['crank_angle [rad]'], columns['driving_torque [N m]'])
    texts = [text.get_text().split() for text in drawn[preset].page.findobj(Text)]
    (row,) = (x[4:] for x in texts if len(x) > 4 and x[:4] == ['Driving', 'torque,', 'N', 'm'])
    assert row[::2] == [f'{x:.4g}' for x in (found.low, found.high, found.rms)]
    assert row[1::2] == [f'{math.degrees(x):.1f}' for x in (found.low_at, found.high_at)]


@pytest.mark.parametrize('preset', ALL)
def test_picture_fits_a_page_and_its_axes_are_labelled(drawn, preset):
    page, pixels = drawn[preset].page, drawn[preset].pixels
    assert pixels.shape[0] <= 1800
    _, *diagrams = page.axes
    titles = [axes.get_title('left') for axes in diagrams]
    assert all(titles)
    assert all(axes.get_yticklabels() for axes in diagrams)
    assert 'rad/s\N{SUPERSCRIPT TWO}' in ''.join(titles)
    # All crank angles are below one another, and no quarter of the picture is empty.
    assert len({axes.get_xlim() for axes in diagrams}) == 1
    high, wide = pixels.shape[0] // 2, pixels.shape[1] // 2
    for part in (pixels[:high, :wide], pixels[:high, wide:], pixels[high:, :wide]):
        assert (part.min(axis=2) < 0.9).mean() > 0.01
    boxes = [axes.get_tightbbox() for axes in diagrams]
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))


def test_formats_hold_the_same_picture(tmp_path, called, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, _ = called(command_line, 'motion', '--format', 'png,svg,pdf', 'wiper')
    assert code == 0
    assert out.splitlines()[-4:-1] == [f'wiper_motion.{x}' for x in ('png', 'svg', 'pdf')]
    starts = [Path(f'wiper_motion.{x}').read_bytes()[:5] for x in ('png', 'svg', 'pdf')]
    assert starts == [b'\x89PNG\r', b'<?xml', b'%PDF-']


def names_in_a_movie(period, width, place):
    """Yields the boxes of all names at every 60th crank angle."""
    axes = Figure(figsize=(width, 4.2), dpi=90).add_axes(place)
    positions = period.rows('position')
    picture = LinkagePicture(axes, period.drawing, positions, positions[::60])
    for position in positions[::60]:
        picture.move(position)
        yield [text.get_window_extent() for text in axes.texts]


@pytest.mark.parametrize('preset', preset_names())
def test_names_in_a_movie_do_not_overlap(preset):
    period, _ = period_to_show(preset, load(preset).only, None)
    for boxes in names_in_a_movie(period, 8.0, (0.02, 0.06, 0.5, 0.78)):
        assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))


@pytest.mark.parametrize('name', ['first.yaml', 'quick_return.yaml', 'scissors.yaml'])
def test_a_drawing_is_shown_as_it_is_drawn(name, called, tmp_path, monkeypatch):
    shown = []

    class Picture(LinkagePicture):
        def __init__(self, axes, drawing, positions, now, others):
            shown.append(now)
            super().__init__(axes, drawing, positions, now, others)

    monkeypatch.setattr(sketch, 'LinkagePicture', Picture)
    file = tmp_path / name
    file.write_text(block(read('docs/drawings.md'), f'# {name}\n'))
    assert called(command_line, 'motion', file, '--out', tmp_path)[0] == 0
    mechanism = load(str(file)).mechanism
    drawn = Solver(mechanism).state(mechanism.drawn.position).position
    ((now,),) = shown
    assert now == pytest.approx(drawn, abs=0.02)  # half a degree of the crank


def test_names_of_pins_at_the_edge_are_whole():
    first, second = Body(length=0.5), Body(length=0.35)
    ram = Dyad(
        name='a_long_name', from_='coupler', from_at=(0.2, 0.1), to='frame', to_at=(0.3, 0.7),
        first=first, second=second,
    )  # fmt: skip
    mechanism = FourBar(
        frame=Frame(length=0.5, angle=0.2), crank=Body(length=0.12), coupler=Coupler(length=0.45),
        rocker=Body(length=0.3), dyads=(ram,),
    )  # fmt: skip
    period = speed_driven_period(mechanism, 1.0)
    for _, *boxes in names_in_a_movie(period, 6.0, (0.01, 0.06, 0.31, 0.78)):
        assert min(box.x0 for box in boxes) >= 0


def test_wind_pump_is_drawn_in_its_settled_state(drawn):
    speed, stroke = 2.604, 0.519
    assert f'settled at {speed} rad/s' in drawn['wind_pump'].said[0]
    columns = drawn['wind_pump'].columns
    crank, rate = columns['crank_angle [rad]'], columns['crank.angular_velocity [rad/s]']
    assert (crank[0], crank[-1], len(crank)) == (0.0, 2 * math.pi, 721)
    assert np.ptp(columns['slider.position [m]']) == pytest.approx(stroke, abs=5e-4)
    # The motor torque, from the balance of all bodies.
    assert columns['driving_torque [N m]'] == pytest.approx(8.4 - 1.2 * rate, rel=1e-9)
    # Rates are derivatives with respect to time along the turn.
    steps = np.diff(elapsed(crank, rate))
    assert 2 * math.pi / steps.sum() == pytest.approx(speed, abs=5e-4)
    for joint, names in (('coupler', TURNING), ('rod', TURNING), ('slider', SLIDING)):
        motion = [columns[f'{joint}.{word} [{unit}]'] for word, unit in names]
        for values, slope in itertools.pairwise(motion):
            middle = (slope[1:] + slope[:-1]) / 2
            close = {'abs': 1e-4 * np.abs(slope).max()}
            assert np.diff(values) / steps == pytest.approx(middle, **close)


def test_mean_power_of_a_settled_pump_equals_the_loss_at_its_slider():
    pump = load('wind_pump')
    settled = settle(pump.mechanism, pump.drive.motor, 2.0)
    turn = settled_period(settled)
    rate, slide = (turn.motion(name, 'velocity').values for name in ('crank', 'slider'))
    time = elapsed(turn.crank, rate)
    taken = trapezoid(60.0 * slide**2, time) / time[-1]
    assert turn.mean_power == pytest.approx(taken, rel=1e-4)


def test_all_forces_of_a_load_have_columns_except_reactions_on_other_links():
    mechanism = replace(load('quadrilateral').mechanism, loads=(SEVERAL_FORCES,))
    columns = speed_driven_period(mechanism, 2.0).columns
    assert {name: {*x.values} for name, x in columns.items() if '.force' in name} == {
        'tool.force.x': {15.0},
        'tool.force.y': {3.0},
        'tool.2.force.x': {0.0},
        'tool.2.force.y': {7.0},
    }


def test_transmission_ratios_match_document_2_even_at_rest():
    """Mottola 2017, eq. (32) and (33)."""
    mechanism = load('quadrilateral').mechanism
    columns = speed_driven_period(mechanism, 0.0).columns
    two, three, four = (
        columns[f'{link}.direction'].values for link in ('crank', 'coupler', 'rocker')
    )
    for link, length, other in (
        ('coupler', mechanism.coupler.length, four),
        ('rocker', mechanism.rocker.length, three),
    ):
        wanted = mechanism.crank.length / length * np.sin(two - other) / np.sin(four - three)
        assert columns[f'{link}.transmission_ratio'].values == pytest.approx(wanted, abs=1e-14)
    slider = speed_driven_period(load('slider_crank').mechanism, 1.0).columns
    moved = slider['slider.velocity'].values
    assert slider['slider.transmission_ratio'].values == pytest.approx(moved, abs=1e-15)


@pytest.mark.parametrize('gap', [1e-3, 1e-9])
def test_sharp_peaks_near_change_points_are_sampled(gap):
    """Samples are denser where the motion is fast; a grid of 0.5 deg would miss the peak."""
    crank, body = Body(0.1), {'mass': 1.0, 'inertia': 0.01}
    coupler, rocker = Coupler(0.2, center=(0.1, 0.0), **body), Body(0.3 + gap, **body)
    period = speed_driven_period(FourBar(Frame(0.4, 0.3), crank, coupler, rocker), 2 * math.pi)
    found = extent(period.crank, period.columns['coupler.angular_acceleration'].values)
    # To first order in the gap, the acceleration peaks at theta = pi itself.
    at_pi = period.solver.state(0.3 + math.pi, 2 * math.pi)
    assert found.high == pytest.approx(at_pi.acceleration[1], rel=max(1e-3, 10 * gap))
    power = period.columns['driving_power'].values
    assert abs(mean(period.crank, power)) < 0.02 * np.sqrt(mean(period.crank, power**2))
    assert period.mean_power == 0.0


def test_period_of_two_turns_is_drawn_completely(tmp_path, called):
    odd = tmp_path / 'cost_$5_$x{.yaml'  # matplotlib must not parse the file name as math
    odd.write_text(CHANGE_POINT)
    code, out, _ = called(command_line, 'motion', odd, '--rpm', '6', '--out', tmp_path)
    assert code == 0
    assert 'change-point' in out
    columns = table(tmp_path / 'cost_$5_$x{_motion.csv')
    assert columns['crank_angle [rad]'][-1] == 4 * math.pi
    rocker = columns['rocker.direction [rad]']
    assert np.abs(np.diff(rocker)).max() < 0.03
    assert rocker[-1] == pytest.approx(rocker[0], abs=1e-13)


@pytest.mark.parametrize(('preset', 'way'), [('compressor', 1), ('wind_pump', 1), ('wiper', -1)])
def test_movie_frames_are_evenly_spaced_in_time(tmp_path, monkeypatch, called, preset, way):
    shown, frames_of = [], movie._frames
    monkeypatch.setattr(movie, '_SECONDS', 0.5)
    monkeypatch.setattr(
        movie, '_frames', lambda period: shown.append((period, frames_of(period))) or shown[-1][1]
    )
    options = ('--rpm', -30) if way < 0 else ()
    code, out, _ = called(command_line, 'movie', preset, tmp_path / 'made.gif', *options)
    said, path = out.splitlines()
    assert code == 0
    assert said.startswith(preset)
    with Image.open(path) as file:
        frames = [np.array(frame.convert('RGB'), int) for frame in ImageSequence.Iterator(file)]
        assert file.info['duration'] == 50
    assert len(frames) == 10
    assert all(np.abs(one - other).sum() for one, other in itertools.pairwise(frames))
    ((period, samples),) = shown
    speed = np.abs(period.columns['crank.angular_velocity'].values)
    time = elapsed(period.crank, speed)[samples]
    apart, sample = way * np.diff(time), np.diff(period.crank).max() / speed.min()
    assert apart == pytest.approx(apart.mean(), abs=2 * sample)


@pytest.mark.parametrize('works', [True, False])
def test_ffmpeg_gets_all_pictures(tmp_path, monkeypatch, called, works):
    monkeypatch.setattr(movie, '_SECONDS', 0.2)
    monkeypatch.setenv('PATH', f'{tmp_path}:{os.environ["PATH"]}')
    program = tmp_path / 'ffmpeg'
    does = 'for last; do :; done; echo "$* $(wc -c)" > "$last"' if works else 'echo no >&2; exit 1'
    program.write_text(f'#!/bin/sh\n{does}\n')
    program.chmod(0o755)
    code, _, error = called(command_line, 'movie', 'quadrilateral', tmp_path / 'made.mp4')
    assert code == (0 if works else 2)
    if not works:
        assert 'cannot be written: no' in error
        return
    words = (tmp_path / 'made.mp4').read_text().split()
    wide, high = map(int, words[words.index('-s') + 1].split('x'))
    assert int(words[-1]) == 4 * wide * high * 3


def test_several_mechanisms_are_drawn_side_by_side_with_one_table(tmp_path, called):
    names = ['quadrilateral', 'compressor', 'wiper']
    _, out, _ = called(command_line, 'motion', *names, '--reactions', '--out', tmp_path)
    assert out.splitlines()[0].split() == names
    with (tmp_path / 'comparison.csv').open() as stream:
        rows = {row['design']: row for row in csv.DictReader(stream)}
    assert [*rows] == names
    for name, row in rows.items():
        configuration = load(name)
        speed = configuration.drive.rpm * math.pi / 30
        period = speed_driven_period(configuration.mechanism, speed, reactions=True)
        found, columns = travel(period.solver), period.columns
        way, torque = np.ptp(found.extremes), columns['driving_torque'].values
        forces = [columns[f'shaking_force.{axis}'].values for axis in 'xy']
        low, high = map(math.degrees, found.transmission)
        expected = {
            **({'stroke [m]': way} if found.slides else {'swing [deg]': math.degrees(way)}),
            'time ratio': found.time_ratio,
            'least transmission angle [deg]': min(low, 180 - high),
            'peak torque [N m]': np.abs(torque).max(),
            'rms torque [N m]': math.sqrt(trapezoid(torque**2, period.crank) / (2 * math.pi)),
            'mean power [W]': period.mean_power,
            'peak shaking force [N]': np.hypot(*forces).max(),
        }
        given = {word: float(cell) for word, cell in row.items() if word != 'design' and cell}
        assert given == pytest.approx(expected, rel=1e-4)
    pixels = matplotlib.image.imread(tmp_path / 'comparison.png')[..., :3]
    for color in DESIGN_COLORS[: len(names)]:  # the curves of each mechanism
        assert (np.abs(pixels * 255 - color).max(axis=-1) < 2).sum() > 500


TWO = {
    'linkages': ['left', 'right'], 'rpm': 60.0, 'mechanism': 'slider_crank',
    'crank.length': 0.05, 'coupler.length': 0.2, 'slider.mass': 1.0, 'right.crank.length': 0.06,
}  # fmt: skip


def test_linkages_of_one_file_are_compared(tmp_path, called, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('two.yaml').write_text(json.dumps({'/**': {'ros__parameters': TWO}}))
    for name, length in (('two_left', 0.05), ('two_right', 0.06)):
        alone = {x: y for x, y in TWO.items() if x != 'linkages' and '.crank' not in x}
        text = json.dumps({'/**': {'ros__parameters': {**alone, 'crank.length': length}}})
        Path(f'{name}.yaml').write_text(text)
    both = '--linkage', 'left', '--linkage', 'right'
    told = {}
    for words in (['two.yaml', *both], ['two_left.yaml', 'two_right.yaml']):
        code, out, error = called(command_line, 'motion', *words, '--format', 'svg', '--overwrite')
        assert code == 0, error
        picture = Path('comparison.svg').read_text(encoding='utf-8')
        assert all(f'<!-- {name} -->' in picture for name in ('two_left', 'two_right'))
        told[words[0]] = out, Path('comparison.csv').read_text()
    one, other = told.values()
    assert one == other
    assert one[1].splitlines()[1].startswith('two_left,')
    code, out, error = called(
        command_line, 'motion', 'two.yaml', 'wiper', '--linkage', 'right', '--overwrite'
    )
    assert_refused(code, out, error, "'right': there is one linkage")
    twice = 'motion', 'two.yaml', '--linkage', 'left', '--linkage', 'left'
    assert_refused(*called(command_line, *twice), 'two_left is given twice')
    assert_refused(*called(command_line, 'motion', 'two.yaml'), 'right: choose .*--linkage')
    many = [word for _ in range(8) for word in ('--linkage', 'left')]
    assert_refused(*called(command_line, 'motion', 'two.yaml', *many), 'at most 7')


@pytest.mark.parametrize(
    ('command', 'files'),
    [
        (['motion', '--fluctuation', '0.1'], ['flywheel.png', 'motion.csv', 'motion.png']),
        (['sketch'], ['sketch.png']),
        (['economy', '--quick'], ['economy.json', 'economy.png']),
    ],
    ids=lambda words: words[0],
)
def test_names_of_files_and_titles_tell_the_linkage(command, files, tmp_path, called, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('two.yaml').write_text(json.dumps({'/**': {'ros__parameters': TWO}}))
    first, *more = command
    code, out, error = called(command_line, first, 'two.yaml', '--linkage', 'right', *more)
    assert code == 0, error
    assert sorted(path.name for path in tmp_path.glob('*_*')) == [f'two_right_{x}' for x in files]
    assert out.startswith('two_right')


def test_a_sheet_without_diagrams_says_what_is_constant(tmp_path, called, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = CHANGE_POINT.replace(', mass: 1.0, center: [1.5, 0.2]', '')
    for name in ('one', 'other'):
        Path(f'{name}.yaml').write_text(text)
    options = '--show', 'torque', '--format', 'svg'
    for files in (['one.yaml'], ['one.yaml', 'other.yaml']):
        code, _, error = called(command_line, 'motion', *files, *options)
        assert code == 0, error
    assert 'constant: driving torque' in Path('comparison.svg').read_text(encoding='utf-8')


def test_diagrams_of_several_mechanisms_have_titles(tmp_path, called):
    options = '--show', 'position', 'velocity', 'torque', '--format', 'svg', '--out', tmp_path
    called(command_line, 'motion', 'press', 'compressor', *options)
    picture = (tmp_path / 'comparison.svg').read_text(encoding='utf-8')
    titles = 'Position, m', 'Velocity, m/s', 'Driving torque, N m'
    assert all(f'<!-- {title} -->' in picture for title in titles)
    assert 'Press and' not in picture


@pytest.mark.parametrize(
    ('line', 'words'),
    [
        ('motion pentagon', "no preset 'pentagon'"),
        ('motion quadrilateral --rpm nan', "--rpm: 'nan': must be a number from"),
        ('motion quadrilateral --acceleration 1e99', "--acceleration: '1e99': must be"),
        ('pump --speeds 2 x', "--speeds: 'x': must be a number from 1e-06 to 1e+06 rad"),
        ('motion wind_pump --reactions', '--reactions is for a crank at a given speed, but the'),
        ('motion wind_pump --fluctuation 0.1', 'leave --fluctuation out'),
        ('motion wind_pump --csv 5', '--csv is for a crank at a given speed'),
        ('motion wiper press --csv 5', 'only one with --fluctuation or --csv'),
        ('motion wiper --csv 0', "--csv: '0': must be a number from 0.01 to 180"),
        ('motion wind_pump --rpm 0', '--rpm = 0: must be above 0 rpm, because'),
        ('motion wiper --format jpg', "--format: 'jpg': must be of png,svg,pdf"),
        ('motion wiper --show x', 'point; PARAMS must be before --show'),
        ('motion --show torque wiper', "'wiper': must be of position, "),
        ('motion wiper out.png', 'out.png: give parameter files alone'),
        ('motion wiper wiper', 'wiper is given twice: give each file another name'),
        ('motion wiper press --fluctuation 0.1', '2 mechanisms: must be at most 7, and only one'),
        ('motion 0 1 2 3 4 5 6 7', '8 mechanisms: must be at most 7'),
        ('movie wiper wiper.png', 'wiper.png: must end with .html, .gif or .mp4'),
        ('movie wiper wiper.gif --rpm 0', 'the crank is at rest'),
        ('motion quadrilateral --fluctuation 0', "'0': must be a number from 1e-06 to 1"),
        ('motion wiper --fluctuation 0.1 --rpm 0', 'not for 0 rpm and 0 rad/s^2: change'),
        ('motion wiper --fluctuation 0.1 --acceleration 1', 'not for 45 rpm and 1 rad/s^2'),
        ('economy wind_pump --rpm 20', 'its crank angle alone does not determine its motion'),
        ('economy quadrilateral --rpm 0', 'quadrilateral at 0 rpm: the torque is'),
        ('economy quadrilateral --tolerance 0', "'0': must be a number from 1e-09"),
        ('economy', 'PARAMS'),
        ('', 'COMMAND'),
    ],
)
def test_invalid_chart_arguments_give_one_line(called, line, words):
    assert_refused(*called(command_line, *line.split()), re.escape(words))


def test_default_bandwidth_in_the_chart_is_that_of_the_drive():
    assert FollowDrive().follow_bandwidth == accuracy.DEFAULT_BANDWIDTH


@pytest.mark.parametrize('drive', ['torque', 'follow'])
def test_speed_that_a_file_does_not_give_is_assumed(tmp_path, called, drive):
    path = tmp_path / 'crank.yaml'
    values = {**FOLLOWED, 'drive': drive}
    path.write_text(json.dumps({'/**': {'ros__parameters': values}}))
    code, out, err = called(command_line, 'motion', path, '--out', tmp_path)
    assert code == 0, err
    assert '1 rpm (assumed)' in out
    code, out, _ = called(
        command_line, 'motion', path, '--rpm', '2', '--out', tmp_path, '--overwrite'
    )
    assert code == 0
    assert 'assumed' not in out
    wheel = '--fluctuation', '0.02', '--overwrite', '--out', tmp_path
    assert_refused(*called(command_line, 'motion', path, *wheel), 'such as --rpm 60')


@pytest.mark.parametrize('rpm', [60.0, -60.0])
@pytest.mark.parametrize(
    ('load', 'is_noted'),
    [
        # A resistance against the motion, and the same with the wrong sign.
        ('{x: {kind: curve, link: crank, at: [0.0], value: [VALUE]}}', None),
        (
            '{x: {kind: spring, link: rocker, at: [0.1, 0.0], to_at: [0.3, 0.1], stiffness: 5e2}}',
            False,
        ),
        ('{x: {kind: pins, damping: 0.1}}', False),
    ],
)
def test_loads_that_drive_the_crank_are_noted(
    tmp_path, monkeypatch, called, undrawn, rpm, load, is_noted
):
    monkeypatch.chdir(tmp_path)
    for value in (5.0, -5.0):
        own = f'rpm: {rpm}\n    loads: {load.replace("VALUE", str(value))}'
        Path('own.yaml').write_text(CHANGE_POINT.replace('rpm: 60.0', own))
        code, _, noted = called(command_line, 'motion', 'own.yaml', '--overwrite')
        expected = value * rpm > 0 if is_noted is None else is_noted
        assert (code, 'loads drive the crank' in noted) == (0, expected)


@pytest.mark.parametrize('preset', preset_names())
def test_loads_of_a_preset_do_not_drive_it(preset):
    configuration = load(preset)
    period, _ = period_to_show(preset, configuration.only, None)
    assert _driven_by_loads({preset: configuration}, {preset: period}) == []


@pytest.mark.parametrize(
    'words',
    [
        ['motion', 'turned.yaml'],
        ['movie', 'turned.yaml', 'turned.html'],
        ['economy', 'turned.yaml', '--quick', '--rpm', '60'],
        ['mjcf', 'turned.yaml', 'turned.xml'],
        ['sweep', 'study.yaml'],
    ],
)
def test_unit_that_is_probably_wrong_is_noted_once(tmp_path, monkeypatch, called, undrawn, words):
    monkeypatch.chdir(tmp_path)
    turned = CHANGE_POINT.replace('rpm: 60.0', 'rpm: 60.0\n    crank_angle: 30.0')
    Path('turned.yaml').write_text(turned)
    study = 'base: turned.yaml\ndesigns: 4\nranges: {coupler.mass: [1.0, 2.0]}\n'
    Path('study.yaml').write_text(f'{study}measures: [peak_torque]\n')
    _, out, noted = called(export if words[0] == 'mjcf' else command_line, *words)
    assert 'note' not in out
    (line,) = re.findall('note: .*crank_angle.*', noted)
    assert 'crank_angle = 30 rad = 278.9 deg' in line
