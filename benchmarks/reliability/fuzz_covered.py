# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One target of the coverage-guided fuzzer; fuzz.py --coverage starts it.

Files are changed where that reaches new lines. Checksums are of no help to a forger, who can
compute them: they are made right, or not asked for. A finding is a file FOLDER/KIND-NUMBER, with
its traceback in FOLDER/KIND-NUMBER.txt; a hang or too much memory ends the process, and leaves
FOLDER/timeout-HASH or oom-HASH. A machine that was busy or stood still looks like a hang: try such
a file alone.
Options and live parameters are those of test/hostile.py, drawn as the bytes of the fuzzer say.
Usage: python fuzz_covered.py TARGET SECONDS FOLDER
       python fuzz_covered.py TARGET FILE
TARGET is parameter_file, log, recover, replay_options or live_parameters.
"""

import random
import sys
import tempfile
import time
import traceback
from pathlib import Path

import atheris
import rclpy

sys.path.append(str(Path(__file__).resolve().parents[2] / 'test'))

with atheris.instrument_imports(include=['linkage_ros', 'mcap', 'yaml']):
    import hostile
    import hostile_bombs
    import hostile_logs
    import hostile_outcomes
    import numpy as np

    from linkage_ros import LinkageError
    from linkage_ros.log import metadata
    from linkage_ros.parameters.configuration import load
    from linkage_ros.parameters.presets import preset_names, preset_path
    from linkage_ros.recovery.recover import recover

KNOWN = set()  # where findings so far were raised


class Drawn(random.Random):
    """Draws what some bytes say, and the least there is behind their end."""

    def __init__(self, data):
        super().__init__(0)
        self._bytes = atheris.FuzzedDataProvider(data)

    def getrandbits(self, k):
        return self._bytes.ConsumeUInt(-(-k // 8)) & ((1 << k) - 1)

    def random(self):
        return self.getrandbits(32) / 2**32


def targets(scratch):
    """What is done with some bytes, by name."""
    path = scratch / 'case'

    def parameter_file(data):
        file = path.with_suffix('.yaml')
        file.write_bytes(data)
        hostile_outcomes.parameter_file(file)

    def log(data):
        path.write_bytes(hostile_bombs.resummed(data))
        hostile_outcomes.log_file(path)

    def save(data):
        path.write_bytes(data)
        try:
            recover(path, scratch / 'out', overwrite=True)
        except LinkageError as error:
            hostile_outcomes.one_line(str(error))

    def options(data):
        hostile_outcomes.replay_options(hostile.replay_options(Drawn(data)), path)

    def live(data):
        if not nodes:
            rclpy.init(domain_id=99)
            context = rclpy.get_default_context()
            names = ('quadrilateral', 'wind_pump')
            nodes.extend(hostile_outcomes.LiveNode(load(name), context) for name in names)
        drawn = Drawn(data)
        drawn.choice(nodes).request(hostile.live_parameters(drawn))

    nodes = []
    path.write_bytes(hostile_logs.good_logs(scratch)[0])
    return {
        'parameter_file': parameter_file, 'log': log, 'recover': save,
        'replay_options': options, 'live_parameters': live,
    }  # fmt: skip


def corpus(target, scratch):
    """Good files to begin with; logs without checksums, and not packed."""
    if target == 'parameter_file':
        return [preset_path(name).read_bytes() for name in preset_names()]
    if target in {'replay_options', 'live_parameters'}:
        return [random.Random(seed).randbytes(400) for seed in range(30)]
    logs = hostile_logs.good_logs(scratch)
    return [*logs, *(hostile_logs.bare(log) for log in logs)]


def main():
    """Fuzzes one target."""
    target = sys.argv[1]
    np.seterr(all='raise')
    metadata._unseal = lambda record, _: {  # noqa: SLF001, a forger knows it as well
        name: text for name, text in record.items() if name != 'crc32'
    }
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        if len(sys.argv) == 3:
            before = time.process_time()
            targets(scratch)[target](Path(sys.argv[2]).read_bytes())
            print(f'{time.process_time() - before:.2f} s of processor')
            return
        seconds, folder = sys.argv[2], Path(sys.argv[3])
        begin = folder / 'corpus'
        begin.mkdir(parents=True, exist_ok=True)
        for number, data in enumerate(corpus(target, scratch)):
            (begin / f'good_{number}').write_bytes(data)
        run = targets(scratch)[target]

        def once(data):
            try:
                run(data)
            except Exception as error:  # noqa: BLE001, which is what is looked for
                place = traceback.extract_tb(error.__traceback__)[-1]
                key = type(error).__name__, place.filename, place.lineno
                if key not in KNOWN:
                    KNOWN.add(key)
                    finding = folder / f'{key[0]}-{len(KNOWN)}'
                    finding.write_bytes(data)
                    finding.with_suffix('.txt').write_text(traceback.format_exc())

        options = [f'-max_total_time={seconds}', '-timeout=20', '-rss_limit_mb=1300']
        options += [
            '-max_len=60000',
            f'-artifact_prefix={folder}/',
            '-verbosity=0',
            '-print_final_stats=1',
        ]
        atheris.Setup([sys.argv[0], *options, str(begin)], once)
        atheris.Fuzz()


if __name__ == '__main__':
    main()
