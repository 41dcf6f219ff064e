"""Packaging of boom_model for colcon and pip."""

from setuptools import find_packages, setup

package_name = "boom_model"

setup(
    name=package_name,
    version="0.2.0",
    packages=find_packages(include=[package_name, f"{package_name}.*", "boom_input"]),
    package_data={package_name: ["py.typed", "machines/*.yaml", "codegen/*.c", "fmu/*.c"], "boom_input": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "casadi", "numpy", "pin", "pyyaml"],
    zip_safe=False,
    author="boom developers",
    author_email="boom@example.com",
    maintainer="boom developers",
    maintainer_email="boom@example.com",
    description="The physics of the crane boom: components, full and reduced model, integration; no ROS",
    license="Apache-2.0",
    python_requires=">=3.11",
)
