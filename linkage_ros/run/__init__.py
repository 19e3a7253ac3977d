# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs a configured mechanism: ticks, states, messages and health."""
