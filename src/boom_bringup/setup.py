"""Packaging of boom_bringup for colcon and pip."""

from glob import glob

from setuptools import find_packages, setup

package_name = "boom_bringup"

setup(
    name=package_name,
    version="0.2.0",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={package_name: ["py.typed", "*.xml", "config/*.yaml", "launch/*.launch.py"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
        # ros2 launch looks for these below share/.
        (f"share/{package_name}/launch", sorted(glob("boom_bringup/launch/*.launch.py"))),
        (f"share/{package_name}/config", sorted(glob("boom_bringup/config/*.yaml"))),
    ],
    install_requires=["setuptools", "numpy", "pyyaml", "rich"],
    zip_safe=False,
    author="boom developers",
    author_email="boom@example.com",
    maintainer="boom developers",
    maintainer_email="boom@example.com",
    description="Commands, launch files and the supervisor of the boom",
    license="Apache-2.0",
    python_requires=">=3.11",
    entry_points={"console_scripts": ["boom = boom_bringup.cli:main"]},
)
