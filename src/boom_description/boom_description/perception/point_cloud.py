"""Points as sensor_msgs/PointCloud2 and back."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField

from boom_description.perception.log_fit import PerceptionError

FRAME = "base_link"
POINTS_TOPIC = "/perception/points"
_KINDS = {PointField.FLOAT32: "f4", PointField.FLOAT64: "f8"}


def packed(points: NDArray[np.float64], frame: str, stamp: Any) -> Any:
    """Points (n, 3) [m] as a cloud of float32 x, y, z."""
    cloud = PointCloud2(height=1, width=len(points), point_step=12, row_step=12 * len(points), is_dense=True)
    cloud.header.frame_id, cloud.header.stamp = frame, stamp
    cloud.is_bigendian = sys.byteorder == "big"
    cloud.fields = [
        PointField(name=name, offset=4 * k, datatype=PointField.FLOAT32, count=1) for k, name in enumerate("xyz")
    ]
    cloud.data = points.astype("f4").tobytes()
    return cloud


def unpacked(cloud: Any) -> NDArray[np.float64]:
    """Points (n, 3) [m] of a cloud with fields x, y, z, whatever other fields it has.

    Raises:
        PerceptionError: it has no such fields, or fewer bytes than it says.
    """
    order = ">" if cloud.is_bigendian else "<"
    found = {field.name: field for field in cloud.fields if field.datatype in _KINDS}
    if not set("xyz") <= set(found):
        raise PerceptionError("the cloud has no x, y and z as floating-point numbers")
    offsets = [int(found[name].offset) for name in "xyz"]
    kinds = [order + _KINDS[found[name].datatype] for name in "xyz"]
    ends = [offset + int(kind[2]) for offset, kind in zip(offsets, kinds, strict=True)]
    rows, step, width = int(cloud.row_step), int(cloud.point_step), int(cloud.width)
    if max(ends) > step or width * step > rows or int(cloud.height) * rows > len(cloud.data):
        raise PerceptionError("the cloud is shorter than it says")
    kind = np.dtype({"names": list("xyz"), "formats": kinds, "offsets": offsets, "itemsize": step})
    table = np.ndarray((int(cloud.height), width), kind, bytes(cloud.data), 0, (rows, step))
    return np.column_stack([table[name].reshape(-1).astype(float) for name in "xyz"])
