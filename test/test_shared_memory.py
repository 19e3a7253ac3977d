# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Leftovers of killed processes in Fast DDS's shared memory."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from ros_harness import command, environment

from linkage_ros import ConfigurationError
from linkage_ros.ros import shared_memory
from linkage_ros.ros.shared_memory import remove_half_made

NODE = 'import rclpy; rclpy.init(); rclpy.create_node("x"); print("made")'


def port_of(domain, folder=Path('/dev/shm')):
    """The port that the first participant of a domain makes for its messages."""
    return folder / f'fastrtps_port{7400 + 250 * domain + 11}'


def make(path, data=b'', age=60.0):
    path.write_bytes(data)
    os.utime(path, (then := time.time() - age, then))
    return path


@pytest.fixture
def leftover():
    """(domain, port), in a domain that no other test or benchmark takes, and so none clears up."""
    domain = 1 + os.getpid() % 9
    port = make(port_of(domain))
    yield domain, port
    port.unlink(missing_ok=True)


def test_a_program_starts_where_a_killed_one_left_a_port_half_made(leftover):
    domain, port = leftover
    done = subprocess.run(
        command('controller', '--ros-args', '-p', 'rmp:=6.0'), env=environment(domain),
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    words = f'{port} is removed: a killed process had left it half made'
    warning, error = done.stderr.splitlines()
    assert words in warning
    assert "'rmp' is not a parameter" in error


def test_without_the_removal_it_would_wait_for_ever(leftover):
    domain, _ = leftover
    with pytest.raises(subprocess.TimeoutExpired):
        subprocess.run(
            [sys.executable, '-c', NODE], env=environment(domain), timeout=5, check=True
        )


@pytest.mark.parametrize('data', [b'', bytes(100), b'\1' + bytes(100), b'\2' + bytes(10)])
def test_what_was_never_made_is_removed(tmp_path, monkeypatch, data):
    monkeypatch.setattr(shared_memory, '_FOLDER', tmp_path)
    left = make(port_of(7, tmp_path), data)
    others = [make(port_of(6, tmp_path), data), make(port_of(8, tmp_path), data)]
    others += [make(tmp_path / f'{left.name}_el', data), make(tmp_path / 'fastrtps_1f', data)]
    assert remove_half_made(7) == [left]
    assert sorted(tmp_path.iterdir()) == sorted(others)


def test_where_there_is_no_shared_memory_there_is_nothing_to_remove(tmp_path, monkeypatch):
    monkeypatch.setattr(shared_memory, '_FOLDER', tmp_path / 'none')
    assert remove_half_made(7) == []


def test_a_pipe_of_that_name_holds_nobody_up(tmp_path, monkeypatch):
    monkeypatch.setattr(shared_memory, '_FOLDER', tmp_path)
    monkeypatch.setattr(shared_memory, '_MAKING_SECONDS', 0.0)
    os.mkfifo(pipe := port_of(7, tmp_path))
    assert remove_half_made(7) == [pipe]
    assert not pipe.exists()


@pytest.mark.parametrize('data', [b'\2' + bytes(100), b'\3' + bytes(100)])
def test_what_is_made_is_left_alone(tmp_path, monkeypatch, data):
    monkeypatch.setattr(shared_memory, '_FOLDER', tmp_path)
    path = make(port_of(7, tmp_path), data)
    assert remove_half_made(7) == []
    assert path.exists()


def test_what_is_being_made_has_its_time(tmp_path, monkeypatch):
    monkeypatch.setattr(shared_memory, '_FOLDER', tmp_path)
    monkeypatch.setattr(shared_memory, '_MAKING_SECONDS', 60.0)
    path = make(port_of(7, tmp_path), age=0.0)
    maker = threading.Timer(0.2, path.write_bytes, [b'\2' + bytes(100)])
    maker.start()
    assert remove_half_made(7) == []
    maker.join()
    assert path.exists()


def test_what_cannot_be_removed_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(shared_memory, '_FOLDER', tmp_path)
    path = make(port_of(7, tmp_path))

    def refuse(*_, **__):
        raise PermissionError(1, 'Operation not permitted')

    monkeypatch.setattr(Path, 'unlink', refuse)
    with pytest.raises(ConfigurationError, match=f'left {path} half made.*remove it .Operation'):
        remove_half_made(7)
