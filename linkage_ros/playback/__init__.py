# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Replay of a log: reader, pace, keys, topics and view."""
