"""Packaging of boom_controller for colcon and pip."""

from setuptools import find_packages, setup

package_name = "boom_controller"

setup(
    name=package_name,
    version="0.2.0",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={package_name: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "casadi", "numpy", "scipy"],
    zip_safe=False,
    author="boom developers",
    author_email="boom@example.com",
    maintainer="boom developers",
    maintainer_email="boom@example.com",
    description="The cascade controller of the inner boom: references, control laws, supervision, node",
    license="Apache-2.0",
    python_requires=">=3.11",
    entry_points={"console_scripts": ["controller = boom_controller.controller_node:main"]},
)
