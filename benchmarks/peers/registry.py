# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The adapters, and which of them can be used here."""

import importlib
import importlib.metadata

# As module and class, in the order of the tables.
ADAPTERS = (
    ('adapter_ours', 'Adapter'),
    ('adapter_pylinkage', 'Adapter'),
    ('adapter_mujoco', 'Adapter'),
    ('adapter_mujoco', 'ColdAdapter'),
    ('adapter_pinocchio', 'Adapter'),
    ('adapter_pinocchio', 'ColdAdapter'),
    ('adapter_sympy', 'Adapter'),
    ('adapter_numba', 'Adapter'),
    ('adapter_c', 'Adapter'),
    ('adapter_c', 'VectorAdapter'),
)


def adapter(index):
    """The class of an adapter; what it needs may be missing, which raises ImportError."""
    module, name = ADAPTERS[index]
    return getattr(importlib.import_module(module), name)


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
