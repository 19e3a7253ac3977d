# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sweeps: many designs of one mechanism, sampled, measured and compared."""
