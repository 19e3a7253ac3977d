# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steady states of a wind pump: settled motions, their stability, and starts that reach them."""
