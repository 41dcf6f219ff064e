"""Packaging of boom_view for colcon and pip."""

from setuptools import find_packages, setup

package_name = "boom_view"

setup(
    name=package_name,
    version="0.2.0",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={package_name: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy"],
    zip_safe=False,
    author="boom developers",
    author_email="boom@example.com",
    maintainer="boom developers",
    maintainer_email="boom@example.com",
    description="Shows the crane moving in a browser, live or from a recording, with the model beside it",
    license="Apache-2.0",
    python_requires=">=3.11",
    entry_points={"console_scripts": ["view = boom_view.view_node:main"]},
)
