"""Packaging of boom_fleet for colcon and pip."""

from setuptools import find_packages, setup

package_name = "boom_fleet"

setup(
    name=package_name,
    version="0.2.0",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={package_name: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "dask", "distributed", "fsspec", "numpy", "pyarrow", "scipy"],
    zip_safe=False,
    author="boom developers",
    author_email="boom@example.com",
    maintainer="boom developers",
    maintainer_email="boom@example.com",
    description="Long recordings and fleets: screen, comparison of each machine with its own past, table",
    license="Apache-2.0",
    python_requires=">=3.11",
)
