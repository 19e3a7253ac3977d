# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Opens pages in Chromium without a window, and controls it through its debugging pipe."""

import base64
import io
import itertools
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.image import imread

PROGRAM = next(filter(None, map(shutil.which, ('chromium', 'google-chrome'))), None)
# WebGL without a graphics card; no requests to other hosts.
_OPTIONS = (
    '--headless', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
    '--no-first-run', '--disable-background-networking', '--disable-component-update',
    '--disable-sync', '--disable-quic', '--window-size=600,400', '--remote-debugging-pipe',
)  # fmt: skip


class _Pipe:
    """Commands of Chromium's DevTools protocol as JSON, each ended by a zero byte."""

    def __init__(self, commands, answers):
        self._commands, self._answers = commands, answers
        self._ids, self._rest = itertools.count(1), b''

    def call(self, method, *, session=None, **parameters):
        words = {'id': next(self._ids), 'method': method, 'params': parameters}
        words |= {'sessionId': session} if session else {}
        self._commands.write(json.dumps(words).encode() + b'\0')
        while (answer := json.loads(self._read())).get('id') != words['id']:
            pass  # an event
        return answer['result']

    def _read(self):
        while b'\0' not in self._rest:
            data = self._answers.read(1 << 16)
            assert data, 'Chromium has ended'
            self._rest += data
        line, _, self._rest = self._rest.partition(b'\0')
        return line


class Page(NamedTuple):
    """An open page.

    Attributes:
        call: Calls a method of the DevTools protocol with keyword arguments; returns its result.
    """

    call: Callable[..., Any]

    def picture(self):
        """Returns a picture of the page, RGB from 0 to 255."""
        data = self.call('Page.captureScreenshot')['data']
        return np.round(255 * imread(io.BytesIO(base64.b64decode(data)))[..., :3])

    def run(self, script):
        """Returns the value of a JavaScript expression."""
        found = self.call('Runtime.evaluate', expression=script, returnByValue=True)
        assert 'exceptionDetails' not in found, found
        return found['result'].get('value')


@contextmanager
def opened_page(url):
    """Opens a page."""
    (its_input, commands), (answers, its_output) = os.pipe(), os.pipe()
    # Chromium reads file descriptor 3 and writes 4.
    script = f'exec "$@" 3<&{its_input} 4>&{its_output}'
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        os.fdopen(commands, 'wb', 0) as commands,
        os.fdopen(answers, 'rb', 0) as answers,
        subprocess.Popen(
            ['bash', '-c', script, 'bash', PROGRAM, *_OPTIONS, f'--user-data-dir={folder}'],
            pass_fds=(its_input, its_output),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        ) as process,
    ):
        os.close(its_input)
        os.close(its_output)
        pipe = _Pipe(commands, answers)
        try:
            target = pipe.call('Target.createTarget', url=url)['targetId']
            session = pipe.call('Target.attachToTarget', targetId=target, flatten=True)
            yield Page(partial(pipe.call, session=session['sessionId']))
            pipe.call('Browser.close')
        finally:
            process.kill()
