# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Replays a log: reading, timing, keys, and publishing."""
