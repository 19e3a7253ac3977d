# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The charts and other commands of linkage_chart, one module each."""
