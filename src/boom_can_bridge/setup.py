"""Packaging of boom_can_bridge for colcon and pip."""

from setuptools import find_packages, setup

package_name = "boom_can_bridge"

setup(
    name=package_name,
    version="0.2.0",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={package_name: ["py.typed", "dbc/*.dbc", "dbc/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "cantools", "numpy", "python-can", "python-can-remote"],
    zip_safe=False,
    author="boom developers",
    author_email="boom@example.com",
    maintainer="boom developers",
    maintainer_email="boom@example.com",
    description="The bridge between the CAN bus of the crane and the ROS topics",
    license="Apache-2.0",
    python_requires=">=3.11",
    entry_points={
        "console_scripts": [
            "bridge = boom_can_bridge.bridge_node:main",
            "bus_server = boom_can_bridge.bus_server:main",
            "enable = boom_can_bridge.enable_node:main",
        ],
    },
)
