# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters from files, presets and command lines, checked in one place.

The parameters of mechanisms and drives are declared in `model` and `motion`. The parameters of a
run are declared here.
"""
