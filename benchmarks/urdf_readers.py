# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The URDF of every preset in Pinocchio, urchin and yourdfpy: names and closed loops.

Each reader loads the text with and without a joint_prefix, must find every link and joint by its
name, and places the links at joint positions from the solver: the loop must close. As a control,
Pinocchio must object to a text whose links are named as its joints. The readers are installed
into an environment of their own, of 0.8 GB. Run: python benchmarks/urdf_readers.py
"""

import argparse
import json
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

READERS = ('pin==4.1.0', 'urchin==0.0.30', 'yourdfpy==0.0.60')
CLOSED = 1e-12  # m
STAMP = 123_456_789  # ns after the start


def cases(folder):
    """Writes the URDFs, and for each what a reader needs to close the loop."""
    from linkage_ros.parameters.configuration import configure, load
    from linkage_ros.parameters.presets import preset_names
    from linkage_ros.run.simulator import Simulator
    from linkage_ros.wire.urdf import make_urdf

    for preset in preset_names():
        for prefix in ('', 'left_'):
            configuration = configure({**load(preset).parameters(), 'joint_prefix': prefix})
            simulator, mechanism = Simulator(configuration), configuration.mechanism
            joints = mechanism.structure().links
            message = simulator.snapshot_at(simulator.begin(0), STAMP).messages[0]
            positions = simulator.joint_states.decode(message)[1][: len(simulator.joints)]
            # The tree is cut where the last two links meet: at their ends, a slider's at its pin.
            ends = {
                f'{prefix}{joint.name}': getattr(getattr(mechanism, joint.name), 'length', 0.0)
                for joint in joints[-2:]
            }
            path = folder / f'{prefix}{preset}.urdf'
            path.write_text(make_urdf(mechanism, prefix))
            yield {
                'path': str(path),
                'positions': dict(zip(simulator.joints, positions, strict=True)),
                'ends': ends,  # m from each link's origin, by joint
            }


def pinocchio(case):
    """The placements of the links, 4x4, by joint."""
    import numpy as np
    import pinocchio as pin

    model = pin.buildModelFromUrdf(case['path'])
    data, q = model.createData(), pin.neutral(model)
    for name, value in case['positions'].items():
        joint = model.joints[model.getJointId(name)]
        # A continuous joint has cosine and sine, a prismatic one its place.
        whole = [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
        q[joint.idx_q : joint.idx_q + joint.nq] = whole
    pin.framesForwardKinematics(model, data, q)
    for name in case['positions']:
        model.getFrameId(name)  # raises where two frames share it
    return {n: data.oMf[model.getFrameId(f'{n}_link')].homogeneous for n in case['positions']}


def urchin(case):
    from urchin import URDF

    robot = URDF.load(case['path'], lazy_load_meshes=True)
    placements = robot.link_fk(cfg=case['positions'], use_names=True)
    return {name: placements[f'{name}_link'] for name in case['positions']}


def yourdfpy(case):
    from yourdfpy import URDF

    robot = URDF.load(case['path'])
    robot.update_cfg(case['positions'])
    return {name: robot.get_transform(f'{name}_link') for name in case['positions']}


def read(folder):
    """Has each reader open each URDF; prints a line for each, returns the number of faults."""
    import importlib.metadata

    faults, listed = 0, json.loads((folder / 'cases.json').read_text())
    for name, reader in (('pin', pinocchio), ('urchin', urchin), ('yourdfpy', yourdfpy)):
        for case in listed:
            placements = reader(case)
            first, second = (
                placements[joint] @ [length, 0.0, 0.0, 1.0]
                for joint, length in case['ends'].items()
            )
            gap = max(abs(first - second))
            faults += not gap < CLOSED
            version = importlib.metadata.version(name)
            stem = Path(case['path']).stem
            print(f'{name} {version}: {stem:21} {len(placements)} links, gap {gap:.1e} m')
    case = listed[0]
    same = folder / 'same_names.urdf'
    same.write_text(Path(case['path']).read_text().replace('_link"', '"'))
    try:
        pinocchio({**case, 'path': str(same)})
    except (ValueError, RuntimeError) as error:
        print(f'control: links named as joints are refused: {str(error).splitlines()[0][:60]}')
    else:
        faults += 1
        print('control: links named as joints were NOT refused')
    return faults


def main():
    """Makes the URDFs and the environment, and ends with 1 where anything is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--read', type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.read:
        return 1 if read(options.read) else 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / 'cases.json').write_text(json.dumps(list(cases(folder))))
        venv.create(folder / 'venv', with_pip=True)
        python = folder / 'venv' / 'bin' / 'python'
        subprocess.run([python, '-m', 'pip', 'install', '--quiet', *READERS], check=True)
        done = subprocess.run([python, __file__, '--read', folder], check=False)
    return done.returncode


if __name__ == '__main__':
    sys.exit(main())
