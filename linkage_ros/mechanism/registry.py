# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Registry of mechanism classes, keyed by their names in parameter files."""

from typing import Any

from linkage_ros.mechanism.drawing import DrawnMechanism
from linkage_ros.mechanism.four_bar import FourBar
from linkage_ros.mechanism.inverted_slider_crank import InvertedSliderCrank
from linkage_ros.mechanism.slider_crank import SliderCrank
from linkage_ros.mechanism.wind_pump import WindPump

# Other packages may add their own mechanisms before they start a program of this package.
MECHANISMS: dict[str, Any] = {
    'four_bar': FourBar,
    'slider_crank': SliderCrank,
    'inverted_slider_crank': InvertedSliderCrank,
    'wind_pump': WindPump,
    'drawing': DrawnMechanism,
}
