# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States and motions in many digits, by equations independent of the package."""
