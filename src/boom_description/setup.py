"""Packaging of boom_description for colcon and pip."""

from glob import glob

from setuptools import find_packages, setup

package_name = "boom_description"

setup(
    name=package_name,
    version="0.2.0",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={package_name: ["py.typed", "config/*.yaml", "urdf/*.urdf"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
        # ros2 launch looks for these below share/.
        (f"share/{package_name}/config", sorted(glob("boom_description/config/*.yaml"))),
        (f"share/{package_name}/urdf", sorted(glob("boom_description/urdf/*.urdf"))),
    ],
    install_requires=["setuptools", "numpy", "pin"],
    zip_safe=False,
    author="boom developers",
    author_email="boom@example.com",
    maintainer="boom developers",
    maintainer_email="boom@example.com",
    description="URDF of the boom and the pose of its tip",
    license="Apache-2.0",
    python_requires=">=3.11",
    entry_points={
        "console_scripts": [
            "log_scene = boom_description.perception.log_scene_node:main",
            "reach_log = boom_description.perception.reach_log_node:main",
            "tip_pose = boom_description.tip_pose_node:main",
        ]
    },
)
