"""Packaging of boom_sim for colcon and pip."""

from setuptools import find_packages, setup

package_name = "boom_sim"

setup(
    name=package_name,
    version="0.2.0",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={package_name: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy", "scipy"],
    zip_safe=False,
    author="boom developers",
    author_email="boom@example.com",
    maintainer="boom developers",
    maintainer_email="boom@example.com",
    description="The stand-in for the crane: the simulated boom with its sensors on ROS topics or behind a CAN bus",
    license="Apache-2.0",
    python_requires=">=3.11",
    entry_points={
        "console_scripts": [
            "simulation = boom_sim.simulation_node:main",
            "ecu = boom_sim.ecu_node:main",
        ],
    },
)
