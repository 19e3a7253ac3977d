# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The package, for colcon and for pip alike."""

import re
from pathlib import Path

from setuptools import find_packages, setup

package_name = 'linkage_ros'

# Read, not imported: NumPy need not be there while the package is being built.
version = re.search(
    r"^__version__ = '(.+)'$",
    Path(package_name, '__init__.py').read_text(encoding='utf-8'),
    flags=re.MULTILINE,
)[1]

# Where no wheel exists an extra is empty, so that installing it succeeds all the same.
has_ros_wheels = (
    "sys_platform == 'linux' and platform_machine == 'x86_64' and python_version < '3.14'"
)
has_rerun_wheels = "sys_platform != 'darwin' or platform_machine == 'arm64'"


def shared(folder: str, pattern: str) -> tuple[str, list[str]]:
    """Install the files of a folder as share/linkage_ros/FOLDER."""
    # A deleted file leaves a dead link behind in the build folder of --symlink-install.
    files = [path.as_posix() for path in Path(folder).glob(pattern) if path.is_file()]
    return f'share/{package_name}/{folder}', sorted(files)


setup(
    name=package_name,
    version=version,
    description='Planar linkages that move exactly: ROS 2 node, log, replay and live view',
    # Beside this file itself: a linked build of colcon has a link to it alone.
    long_description=Path(__file__).resolve().with_name('README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    author='The linkage_ros authors',
    author_email='maintainers@users.noreply.github.com',
    maintainer='The linkage_ros authors',
    maintainer_email='maintainers@users.noreply.github.com',
    license='Apache-2.0',
    classifiers=[
        'Development Status :: 4 - Beta',
        'Intended Audience :: Science/Research',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3',
        'Topic :: Scientific/Engineering',
        'Typing :: Typed',
    ],
    packages=find_packages(include=[package_name, f'{package_name}.*']),
    package_data={package_name: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
        shared('config', '*.yaml'),
        shared('launch', '*.launch.py'),
        shared('rviz', '*.rviz'),
        # Where `ros2 run` looks for executables.
        (
            f'lib/{package_name}',
            ['scripts/linkage_chart', 'scripts/linkage_export', 'scripts/linkage_import'],
        ),
    ],
    entry_points={
        'console_scripts': [
            'linkage_node = linkage_ros.executables:node',
            'linkage_record = linkage_ros.executables:record',
            'linkage_replay = linkage_ros.executables:replay',
            'linkage_log = linkage_ros.executables:log',
            'linkage_controller = linkage_ros.executables:controller',
        ],
    },
    python_requires='>=3.10',
    install_requires=['numpy>=1.26', 'mcap>=1.1', 'lz4', 'zstandard', 'PyYAML', 'tqdm'],
    extras_require={
        'ros': [
            f'{name}; {has_ros_wheels}'
            for name in (
                'ros-rclpy[fastrtps]==7.1.6',
                'ros-jazzy-diagnostic-msgs',
                'ros-jazzy-geometry-msgs',
                'ros-jazzy-rosgraph-msgs',
                'ros-jazzy-sensor-msgs',
                'ros-jazzy-std-msgs',
                'ros-jazzy-trajectory-msgs',
            )
        ],
        'viewer': [f'rerun-sdk; {has_rerun_wheels}'],
        'record': ['scipy'],
        'docs': ['furo', 'myst-parser', 'sphinx', 'sphinx-copybutton'],
        'package': ['twine'],
        'test': [
            'colcon-bash',
            'colcon-ros',
            'gmpy2',  # mpmath uses it if it is installed
            'hypothesis',
            'import-linter',
            'mcap-ros2-support',
            'mpmath',
            'mujoco',
            'mypy',
            'pandas',
            'pytest',
            'pytest-xdist',
            'rosbags',
            'ruff',
            'scipy',
            # From 80 on there is no `develop --editable`, which colcon links with.
            'setuptools<80',
            'types-PyYAML',
            'types-tqdm',
        ],
    },
    zip_safe=True,
)
