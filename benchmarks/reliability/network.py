# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Simulates two hosts by kernel namespaces, connected by a virtual cable that can be cut.

Each host has its own network and its own /dev/shm, so that messages must cross the cable as they
do between two machines. Creating hosts requires root or the right to create user namespaces. They
end with this process, even if it is killed.
"""

import os
import subprocess
from contextlib import closing, contextmanager
from pathlib import Path

from harness import system, unavailable

# Kills a process when its parent ends.
_BOUND = ('setpriv', '--pdeathsig', 'KILL')
_SETUP = 'mount -t tmpfs tmpfs /dev/shm && ip link set lo up && echo made && exec sleep 3600'
_CABLE = 'cable'


class Host:
    """A host: the namespaces of a sleeping process.

    Attributes:
        pid: Process ID of that process.
        address: IPv4 address on the cable.
        user: Whether the host is in a user namespace.
    """

    def __init__(self, address: str, owner: 'Host | None' = None) -> None:
        """Creates a host.

        Args:
            address: IPv4 address on the cable.
            owner: An existing host, whose user namespace the new host shares.
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
        """Returns the command prefix that runs a command on this host, in the current folder."""
        rights = ('--user', '--preserve-credentials') if self.user else ()
        inside = ('--net', '--mount', f'--wd={Path.cwd()}')
        return ('nsenter', f'--target={self.pid}', *rights, *inside, *_BOUND)

    def prefix(self, **variables: str) -> tuple[str, ...]:
        """Returns the prefix of `enter`, with environment variables."""
        return (*self.enter(), 'env', *(f'{name}={value}' for name, value in variables.items()))

    def run(self, *words: str) -> str:
        """Runs a command on this host; returns its output."""
        return system(*self.enter(), *words)

    def plug(self) -> None:
        """Assigns the address to the host's end of the cable, and brings it up."""
        self.run('ip', 'address', 'replace', f'{self.address}/24', 'dev', _CABLE)
        self.run('ip', 'link', 'set', _CABLE, 'up')

    def connected(self) -> bool:
        """Returns whether the link is up, which takes some time after both ends are plugged in.

        DDS uses only the links that are up when a process starts.
        """
        return ' state UP ' in self.run('ip', 'link', 'show', _CABLE)

    def unplug(self) -> None:
        """Cuts the cable; the link of the other host goes down."""
        self.run('ip', 'link', 'set', _CABLE, 'down')

    def vanish(self) -> None:
        """Leaves the network silently; the link of the other host stays up."""
        self.run('ip', 'address', 'flush', 'dev', _CABLE)

    def received(self) -> int:
        """Returns the number of bytes received over the cable."""
        text = Path(f'/proc/{self.pid}/net/dev').read_text()
        return int(text.partition(f'{_CABLE}:')[2].split()[0])

    def close(self) -> None:
        """Ends the host; processes still running on it keep its network until they end."""
        self._holder.kill()
        self._holder.communicate()


@contextmanager
def two_hosts():
    """Creates two hosts connected by a cable that is not plugged in yet."""
    net = f'10.77.{os.getpid() % 250 + 1}'
    with closing(Host(f'{net}.1')) as first, closing(Host(f'{net}.2', first)) as second:
        ends = f'{_CABLE} type veth peer name {_CABLE} netns {second.pid}'
        first.run('ip', 'link', 'add', *ends.split())
        yield first, second
