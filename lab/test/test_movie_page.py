# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of linkage_chart movie: its size, and its behaviour in a browser."""

import base64
import json
import math
import re

import browser
import numpy as np
import pytest
from mechanisms import FOLLOWED, load_values
from PIL import Image
from ros_harness import wait_for
from test_sketch import SPRING

from linkage_lab import command_line
from linkage_lab.charts.movie import _DPI, _layout, _save_gif
from linkage_ros import Solver
from linkage_ros.settings.configuration import load
from linkage_ros.settings.presets import preset_names

LARGEST = 300_000  # bytes
NAMES = 'Crank angle', 'Slider position', 'Slider speed', 'Driving torque', 'Load on the slider'


def page(tmp_path, called, params, *options):
    path = tmp_path / 'linkage.html'
    assert called(command_line, 'movie', params, path, *options)[0] == 0
    return path


@pytest.mark.parametrize('preset', preset_names())
def test_page_of_a_preset_is_small_and_links_to_nothing(tmp_path, called, preset):
    text = page(tmp_path, called, preset).read_text()
    assert len(text.encode()) < LARGEST
    assert '://' not in text
    boxes = re.findall('viewBox="([^"]*)"', text)
    assert [len([*map(float, box.split())]) for box in boxes] == [4, 4]


def test_page_stays_small_however_many_corners_loads_have(tmp_path, called):
    at = np.linspace(0.0, 6.0, 600)
    curve = {
        'kind': 'curve',
        'link': 'crank',
        'at': at.tolist(),
        'value': np.sin(99 * at).tolist(),
    }
    values = {**FOLLOWED, 'drive': 'speed', 'rpm': 30.0, 'loads.curve': curve}
    values |= load_values('link', link='rocker', force=1.0)
    params = tmp_path / '<many & odd>.yaml'
    params.write_text(json.dumps({'/**': {'ros__parameters': values}}))
    path = page(tmp_path, called, params)
    assert path.stat().st_size < LARGEST
    assert '<h1>&lt;many &amp; odd&gt;</h1>' in path.read_text()


@pytest.fixture(scope='module')
def opened(tmp_path_factory):
    if not browser.PROGRAM:
        pytest.skip('no browser here: install chromium')
    path = tmp_path_factory.mktemp('page') / 'compressor.html'
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('sys.argv', ['linkage_chart', 'movie', 'compressor', str(path)])
        assert command_line.main() == 0
    with browser.opened_page(path.as_uri()) as shown:
        wait_for(lambda: shown.run("!!document.querySelector('dd:not(:empty)')"))
        yield shown


def readings(shown):
    script = "[...document.querySelectorAll('dl div')].map((x) => x.innerText.split('\\n'))"
    return {name: float(value.split()[0]) for name, value in shown.run(script)}


def test_values_at_the_slider_equal_the_solver(opened):
    solver, speed = Solver(load('compressor').mechanism), 30 * math.pi
    last = int(opened.run('slider.max'))
    seen = []
    for i in (0, 77, last // 3, last // 2, last - 1, last):
        opened.run(f"slider.value = {i}; slider.dispatchEvent(new Event('input'))")
        found = readings(opened)
        crank = math.radians(opened.run(f'data.across[{i}]'))
        state = solver.state(crank, speed)
        expected = (
            math.degrees(crank), state.position[-1], state.velocity[-1], state.torque,
            solver.load_forces(state)['slider'],
        )  # fmt: skip
        assert [found[name] for name in NAMES] == pytest.approx(expected, rel=1e-3, abs=1e-9)
        assert found['Crank speed'] == 900.0
        seen.append(opened.run("[cursor.getAttribute('x1'), moving[0].getAttribute('points')]"))
    # The first and the last position are the same.
    assert len({x for x, _ in seen}) == len({points for _, points in seen}) + 1 == len(seen)


def test_drawn_crank_has_the_direction_shown(opened):
    opened.run("slider.value = 100; slider.dispatchEvent(new Event('input'))")
    points = opened.run("moving[0].getAttribute('points')")
    (x0, y0), (x1, y1) = np.array(points.split(), float).reshape(-1, 2)
    direction = math.degrees(math.atan2(y0 - y1, x1 - x0))
    assert direction == pytest.approx(readings(opened)['Crank angle'], abs=0.2)


def test_page_plays_until_it_is_paused(opened):
    opened.run("slider.value = 5; slider.dispatchEvent(new Event('input')); play.click()")
    wait_for(lambda: int(opened.run('slider.value')) not in (5, 6))
    opened.run('play.click()')
    stopped = opened.run('[slider.value, play.textContent]')
    assert opened.picture().shape[2] == 3  # at least one frame is drawn
    assert opened.run('[slider.value, play.textContent]') == stopped
    assert stopped[1] == 'Play'


def test_page_fits_a_phone(opened):
    size = {'width': 360, 'height': 740, 'deviceScaleFactor': 2, 'mobile': True}
    opened.call('Emulation.setDeviceMetricsOverride', **size)
    assert opened.run('document.documentElement.scrollWidth') == 360
    box = 'getBoundingClientRect()'
    heights = opened.run(
        f"[...document.querySelectorAll('text,dd,dt,button')].map((x) => x.{box}.height)"
    )
    assert min(heights) > 10
    # The controls are in the window.
    assert opened.run(f'slider.{box}.bottom') <= 740
    opened.call('Emulation.clearDeviceMetricsOverride')


@pytest.mark.skipif(not browser.PROGRAM, reason='no browser here: install chromium')
@pytest.mark.parametrize('preset', ['shaper', 'watt'])
def test_names_of_pins_stay_within_the_picture(tmp_path, called, preset):
    script = """(() => {
      const frame = get('linkage').getBoundingClientRect(), out = [];
      for (let i = 0; i <= last; i += 10) {
        go(i);
        for (const name of document.querySelectorAll('#linkage .name')) {
          const box = name.getBoundingClientRect();
          if (box.left < frame.left || box.right > frame.right)
            out.push(name.textContent);
        }
      }
      return out;
    })()"""
    with browser.opened_page(page(tmp_path, called, preset).as_uri()) as shown:
        wait_for(lambda: shown.run("!!document.querySelector('dd:not(:empty)')"))
        for width, is_mobile in ((1200, False), (360, True)):
            size = {'width': width, 'height': 740, 'deviceScaleFactor': 1, 'mobile': is_mobile}
            shown.call('Emulation.setDeviceMetricsOverride', **size)
            assert shown.run(script) == []


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_page_follows_the_color_scheme(opened, scheme):
    features = [{'name': 'prefers-color-scheme', 'value': scheme}]
    opened.call('Emulation.setEmulatedMedia', features=features)
    corner = opened.picture()[3, 3]
    assert (corner.mean() > 128) == (scheme == 'light')


def test_springs_and_their_pins_are_drawn(tmp_path, called):
    params = tmp_path / 'spring.yaml'
    params.write_text(json.dumps({'/**': {'ros__parameters': SPRING}}))
    text = page(tmp_path, called, params).read_text()
    assert '>gas (strut)</text>' in text
    assert '>G</text>' in text
    assert text.count('stroke-dasharray="5 5"') == 1
    # The page moves all points of all samples, with two numbers of two bytes each.
    points = sum(map(int, re.findall(r'data-points="(\d+)"', text)))
    data = json.loads(re.search(r'const data = (.*);', text)[1])
    assert len(base64.b64decode(data['places'])) == 4 * points * len(data['time'])


def test_film_has_the_colours_of_links_that_its_first_picture_hides(tmp_path):
    pictures = [Image.new('RGB', (60, 40), 'white') for _ in range(40)]
    for picture in pictures[5:]:
        picture.paste((213, 94, 0), (10, 10, 30, 14))
    _save_gif(iter(pictures), tmp_path / 'made.gif')
    with Image.open(tmp_path / 'made.gif') as made:
        made.seek(1)
        assert made.convert('RGB').getpixel((20, 12)) == pytest.approx((213, 94, 0), abs=3)
        assert made.convert('RGB').getpixel((0, 0)) == (255, 255, 255)


@pytest.mark.parametrize('ratio', [0.3, 1.0, 1.5, 2.1, 4.0, 30.0])
def test_film_has_even_pixels_and_room_for_the_linkage(ratio):
    for has_diagram in (False, True):
        size, places = _layout(ratio, has_diagram=has_diagram)
        rows = size[1] * _DPI
        assert rows == pytest.approx(2 * round(rows / 2))
        assert len(places) == 1 + has_diagram
    (left, bottom, width, height), (x, y, wide, high) = places
    assert y + high < bottom or left + width < x
    assert max(left + width, bottom + height, x + wide, y + high) < 1.0
