"""Packaging of boom_bringup for colcon and pip."""

from glob import glob

from setuptools import find_packages, setup

package_name = "boom_bringup"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={package_name: ["py.typed", "*.xml", "config/*.yaml", "launch/*.launch.py", "urdf/*.urdf"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
        # ros2 launch looks for launch and parameter files below share/.
        (f"share/{package_name}/launch", sorted(glob("boom_bringup/launch/*.launch.py"))),
        (f"share/{package_name}/config", sorted(glob("boom_bringup/config/*.yaml"))),
        (f"share/{package_name}/urdf", sorted(glob("boom_bringup/urdf/*.urdf"))),
    ],
    install_requires=["setuptools", "dask", "distributed", "numpy", "pin", "pyyaml", "rich", "scipy"],
    zip_safe=False,
    author="boom developers",
    author_email="boom@example.com",
    maintainer="boom developers",
    maintainer_email="boom@example.com",
    description="Launch files, parameter files, the URDF and the commands of the boom",
    license="Apache-2.0",
    python_requires=">=3.11",
    entry_points={
        "console_scripts": [
            "tip_pose = boom_bringup.tip_pose_node:main",
            "latency = boom_bringup.latency_node:main",
            "boom = boom_bringup.cli:main",
        ],
    },
)
