"""Show a bag in rerun: the crane of its machine moving, and plots of angle, rate, pressures and currents.

    ./boom python -m pip install rerun-sdk
    ./boom python layouts/rerun_bag.py bags/healthy/extended                # in rerun's window
    ./boom python layouts/rerun_bag.py bags/healthy/extended --output F.rrd # as a file for it

Angle [rad], rate [rad/s], pressures [bar, gauge], currents [A].
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from boom_description.shipped import robot_description
from boom_input.channels import CURRENTS, SENSORS
from boom_recording.errors import RecordingError
from boom_recording.loading import load
from boom_recording.recording import Recording

VIEWS = {
    "angle [rad]": ("angle",),
    "rate [rad/s]": ("rate",),
    "pressure [bar]": tuple(sensor.name for sensor in SENSORS if sensor.is_pressure),
    "current [A]": tuple(channel.name for channel in CURRENTS),
}
"""Title of each plot and the signals in it."""
_BAR = 1e-5


def show(recording: Recording, urdf: Path | None, output: Path | None) -> None:
    """Send a recording to rerun's window, or write it to a file.

    Args:
        recording: of a bag.
        urdf: file of the crane, moved by the recorded angle in the recorded pose; None: only plots.
        output: file to write; None: open the window.
    """
    import rerun as rr

    rr.init("boom", spawn=output is None)
    if output is not None:
        rr.save(output)
    rr.send_blueprint(_blueprint(recording, urdf))
    for title, names in VIEWS.items():
        for name in names:
            if name in recording.signals:
                signal = recording.signals[name]
                scale = _BAR if signal.unit == "Pa" else 1.0
                path = f"{title.partition(' ')[0]}/{name}"
                rr.log(path, rr.SeriesLines(names=name.replace("_", " ")), static=True)
                time = rr.TimeColumn("time", duration=signal.time)
                rr.send_columns(path, [time], rr.Scalars.columns(scalars=signal.values * scale))
    if urdf is not None:
        _move(recording, urdf)


def _move(recording: Recording, urdf: Path) -> None:
    """Send the crane and how its joints turn."""
    import rerun as rr

    tree = rr.urdf.UrdfTree.from_file_path(urdf)
    tree.log_urdf_to_recording()
    pose = recording.stored_configuration
    fixed = (
        {} if pose is None else {"outer_boom_joint": pose.outer_boom_angle, "telescope_joint": pose.telescope_length}
    )
    fixed["telescope_stage_joint"] = fixed.get("telescope_joint", 0.0) / 2.0
    for name, value in fixed.items():
        joint = tree.get_joint_by_name(name)
        if joint is not None:
            rr.log(f"joints/{name}", joint.compute_transform(value), static=True)
    boom, angle = tree.get_joint_by_name("inner_boom_joint"), recording.signals["angle"]
    if boom is not None:
        known = np.isfinite(angle.values)
        columns = boom.compute_transform_columns(angle.values[known].tolist())
        rr.send_columns("joints/inner_boom_joint", [rr.TimeColumn("time", duration=angle.time[known])], columns)


def _blueprint(recording: Recording, urdf: Path | None) -> object:
    import rerun.blueprint as rrb

    plots = [
        rrb.TimeSeriesView(origin=title.partition(" ")[0], name=title)
        for title, names in VIEWS.items()
        if any(name in recording.signals for name in names)
    ]
    beside = rrb.EyeControls3D(position=(4.0, -14.0, 4.0), look_target=(4.0, 0.0, 2.5), eye_up=(0.0, 0.0, 1.0))
    crane = [] if urdf is None else [rrb.Spatial3DView(origin="/", name="crane", eye_controls=beside)]
    return rrb.Blueprint(rrb.Horizontal(*crane, rrb.Vertical(*plots)), collapse_panels=True)


def main(words: list[str] | None = None) -> int:
    """Read the bag and show it; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bag", metavar="BAG", type=Path, help="a rosbag2 folder or a .mcap file")
    parser.add_argument("--output", metavar="F.rrd", type=Path, help="write a file in place of opening the window")
    args = parser.parse_args(words)
    try:
        recording = load(args.bag)
    except RecordingError as error:
        parser.error(str(error))
    try:
        import rerun  # noqa: F401
    except ImportError:
        parser.error("rerun is not installed: ./boom python -m pip install rerun-sdk")
    known = recording.stored_configuration
    urdf = robot_description(known.machine) if known else ""
    show(recording, Path(urdf) if urdf else None, args.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
