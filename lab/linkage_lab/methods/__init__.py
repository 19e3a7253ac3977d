# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Methods of solving a linkage, compared in the charts of accuracy and stability."""
