# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a user may set: parameters of files, presets and command lines, checked once."""
