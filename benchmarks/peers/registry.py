# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lists the adapters, and finds those that can be used on this machine."""

import importlib
import importlib.metadata

# Module, class, and whether each state starts from the first one, in the order of the tables.
ADAPTERS = (
    ('adapter_ours', 'Adapter', False),
    ('adapter_pylinkage', 'Adapter', False),
    ('adapter_mujoco', 'Adapter', False),
    ('adapter_mujoco', 'Adapter', True),
    ('adapter_pinocchio', 'Adapter', False),
    ('adapter_pinocchio', 'Adapter', True),
    ('adapter_sympy', 'Adapter', False),
    ('adapter_numba', 'Adapter', False),
    ('adapter_c', 'Adapter', False),
    ('adapter_c', 'VectorAdapter', False),
)


def adapter(index):
    """Returns the class of an adapter; raises ImportError if its library is missing."""
    module, name, is_cold = ADAPTERS[index]
    found = getattr(importlib.import_module(module), name)
    if not is_cold:
        return found
    cold = {'name': f'{found.name}, cold', 'how': found.COLD, 'cold': True}
    return type(found.__name__, (found,), cold)


def usable(mechanism, speed, first, left_out):
    """Yields index and adapter of each peer that is installed.

    Args:
        mechanism: The four-bar.
        speed: Crank speed, rad/s.
        first: Crank angle of the first state, rad.
        left_out: List to which the missing peers are appended, with the reasons.
    """
    for index, (module, _, _) in enumerate(ADAPTERS):
        try:
            yield index, adapter(index)(mechanism, speed, first)
        except ImportError as error:  # noqa: PERF203, once for each peer
            left_out.append(f'{module.removeprefix("adapter_")}: {error}')
            print('left out:', left_out[-1], flush=True)


def version(peer):
    """Returns the version of a peer; None if it has no package."""
    if peer.distribution is None:
        return None
    return importlib.metadata.version(peer.distribution)
