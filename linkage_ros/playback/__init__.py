# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Replaying a log: reading ahead, pace, keys, topics and view."""
