"""Packaging of boom_report for colcon and pip."""

from setuptools import find_packages, setup

package_name = "boom_report"

setup(
    name=package_name,
    version="0.2.0",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={
        package_name: [
            "py.typed",
            "*.css",
            "*.js",
            "*.html",
            "*/*.html",
            "diagnosis/*.css",
            "view/*.css",
            "view/*.js",
            "vendor/*",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "jinja2", "markupsafe", "numpy", "rich"],
    zip_safe=False,
    author="boom developers",
    author_email="boom@example.com",
    maintainer="boom developers",
    maintainer_email="boom@example.com",
    description="HTML reports and terminal tables of validation, identification, diagnosis and tracking",
    license="Apache-2.0",
    python_requires=">=3.11",
)
