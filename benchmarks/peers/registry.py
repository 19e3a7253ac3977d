# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The adapters, and which of them can be used here."""

import importlib
import importlib.metadata

# As module, class, and whether each state begins anew, in the order of the tables.
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
    """The class of an adapter; what it needs may be missing, which raises ImportError."""
    module, name, is_cold = ADAPTERS[index]
    found = getattr(importlib.import_module(module), name)
    if not is_cold:
        return found
    cold = {'name': f'{found.name}, cold', 'how': found.COLD, 'cold': True}
    return type(found.__name__, (found,), cold)


def attempt(index, mechanism, speed, first):
    """An adapter, put together; None where that cannot be done here, which it says."""
    try:
        return adapter(index)(mechanism, speed, first)
    except ImportError as error:
        print(f'left out: {ADAPTERS[index][0].removeprefix("adapter_")}: {error}', flush=True)
        return None


def usable(mechanism, speed, first):
    """Yields the index of each adapter that can be used here, and the adapter."""
    for index in range(len(ADAPTERS)):
        peer = attempt(index, mechanism, speed, first)
        if peer is not None:
            yield index, peer


def version(peer):
    """Of the peer; None for what has no package."""
    if peer.distribution is None:
        return None
    return importlib.metadata.version(peer.distribution)
