# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Takes pictures of pages in Chromium without a window, through its debugging pipe."""

import base64
import io
import itertools
import json
import os
import shutil
import subprocess
import tempfile
from contextlib import contextmanager

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

    def call(self, method, session=None, **parameters):
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


@contextmanager
def opened_page(url):
    """Opens a page; yields a function that returns a picture of it, RGB from 0 to 255."""
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

            def picture():
                data = pipe.call('Page.captureScreenshot', session['sessionId'])['data']
                return np.round(255 * imread(io.BytesIO(base64.b64decode(data)))[..., :3])

            yield picture
            pipe.call('Browser.close')
        finally:
            process.kill()
