# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts a program of linkage_ros with the examples of this folder.

    python docs/examples/run.py record docs/examples/cardan_gear.yaml gear.mcap
    python docs/examples/run.py chart motion docs/examples/cardan_gear.yaml

The arguments after the name of the program are passed to the program.
"""

from __future__ import annotations

import argparse
import sys
from importlib import import_module

from linkage_ros import executables


def main() -> int:
    """Imports the examples, which register themselves, and starts the program."""
    names = ('record', 'log', 'replay', 'chart', 'node')
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('program', choices=names, help='linkage_record, linkage_log, ...')
    program = parser.parse_args(sys.argv[1:2]).program
    del sys.argv[1]
    import_module('cardan_gear')
    import_module('fan')
    if program == 'chart':  # of linkage_lab, which alone uses methods of solving
        import_module('inverse_cosine')
        start = import_module('linkage_lab.command_line').main
    else:
        start = getattr(executables, program)
    code: int = start()
    return code


if __name__ == '__main__':
    sys.exit(main())
