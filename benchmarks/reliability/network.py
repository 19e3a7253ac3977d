# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two hosts on this machine: namespaces of the kernel, joined by a cable that can be cut.

Each has its own network and its own /dev/shm, so that messages cross the cable, as between two
machines, and no way out: nothing leaves the pair. Root can make them, and elsewhere a user who
may make user namespaces. They have no names; they go with this process, whatever ends it.
"""

import os
import subprocess
from contextlib import closing, contextmanager
from pathlib import Path

from harness import system, unavailable

# Ends a process with the one that started it.
_BOUND = ('setpriv', '--pdeathsig', 'KILL')
_SETUP = 'mount -t tmpfs tmpfs /dev/shm && ip link set lo up && echo made && exec sleep 3600'
_CABLE = 'cable'


class Host:
    """A host, held by a process that sleeps.

    Attributes:
        pid: Process ID of that process.
        address: On the cable.
        user: Whether it lives in a user namespace.
    """

    def __init__(self, address: str, owner: 'Host | None' = None) -> None:
        """Makes a host.

        Args:
            address: On the cable.
            owner: A host that was made before, whose user this one shares.
        """
        self.address = address
        self.user = os.geteuid() != 0
        rights = ['--user', '--map-root-user'] if self.user and not owner else []
        before = owner.enter() if owner else ()
        self._holder = subprocess.Popen(
            [*before, 'unshare', *rights, '--net', '--mount', *_BOUND, 'sh', '-c', _SETUP],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        self.pid = self._holder.pid
        assert self._holder.stdout
        if (said := self._holder.stdout.readline().strip()) != 'made':
            unavailable(said or 'unshare fails')

    def enter(self) -> tuple[str, ...]:
        """Words before a command that make it run on this host, in this very folder."""
        rights = ('--user', '--preserve-credentials') if self.user else ()
        inside = ('--net', '--mount', f'--wd={Path.cwd()}')
        return ('nsenter', f'--target={self.pid}', *rights, *inside, *_BOUND)

    def prefix(self, **variables: str) -> tuple[str, ...]:
        """Likewise, with variables of the environment."""
        return (*self.enter(), 'env', *(f'{name}={value}' for name, value in variables.items()))

    def run(self, *words: str) -> str:
        """Runs a command on this host; returns its output."""
        return system(*self.enter(), *words)

    def plug(self) -> None:
        """Gives the host's end of the cable its address, and takes it up."""
        self.run('ip', 'address', 'replace', f'{self.address}/24', 'dev', _CABLE)
        self.run('ip', 'link', 'set', _CABLE, 'up')

    def connected(self) -> bool:
        """Whether the link is up: some time after both ends were plugged in.

        DDS uses those links alone that are up when a process begins.
        """
        return ' state UP ' in self.run('ip', 'link', 'show', _CABLE)

    def unplug(self) -> None:
        """Cuts the cable: the other host sees that its link is down."""
        self.run('ip', 'link', 'set', _CABLE, 'down')

    def vanish(self) -> None:
        """Leaves the network silently: the other host's link stays up, nobody answers."""
        self.run('ip', 'address', 'flush', 'dev', _CABLE)

    def received(self) -> int:
        """Number of bytes received over the cable."""
        text = Path(f'/proc/{self.pid}/net/dev').read_text()
        return int(text.partition(f'{_CABLE}:')[2].split()[0])

    def close(self) -> None:
        """Ends the host; what still runs there keeps its network until it ends."""
        self._holder.kill()
        self._holder.communicate()


@contextmanager
def two_hosts():
    """Makes two hosts with a cable between them that is not plugged in yet."""
    net = f'10.77.{os.getpid() % 250 + 1}'
    with closing(Host(f'{net}.1')) as first, closing(Host(f'{net}.2', first)) as second:
        ends = f'{_CABLE} type veth peer name {_CABLE} netns {second.pid}'
        first.run('ip', 'link', 'add', *ends.split())
        yield first, second
