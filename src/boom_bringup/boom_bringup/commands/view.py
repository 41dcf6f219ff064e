"""Show the crane moving in a browser: a recording, or the running machine, each with the model beside it.

The page shows the crane in 3D with the model's as a ghost, the hydraulic scheme of the machine file with pressures and
flows, plots that follow, a slider, and marks where machine and model part. It is served on this computer only
(127.0.0.1) until Ctrl-C, and needs no network. To try the live page, type in two more terminals:

  ./boom sim
  ./boom replay bags/healthy/extended

  ./boom view bags/healthy/extended                      a recording
  ./boom view bags/healthy/extended --output crane.html  the same as one file to mail
  ./boom view                                            the running machine
"""

from __future__ import annotations

import argparse
import math
import os
import webbrowser

from boom_bringup import arguments
from boom_bringup.cli import UsageError
from boom_bringup.node_command import become_node
from boom_bringup.outputs import PAGE, checked, write_text
from boom_bringup.replica import machine_of, misfit
from boom_bringup.showing import progress

HELP = "show the moving crane in a browser, live or from a recording, with the model beside it"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "bag",
        nargs="?",
        metavar="BAG",
        help="recording: a rosbag2 folder or a .mcap file (default: the running machine)",
    )
    parser.add_argument(
        "--machine", metavar="FILE",
        help="machine file, or the name of a shipped one (default: the machine that recording or configuration name)",
    )  # fmt: skip
    arguments.add_configuration(parser)
    arguments.add_other_joints(parser)
    parser.add_argument(
        "--from", dest="start", type=arguments.finite, metavar="S", help="of a recording: first second shown [s]"
    )
    parser.add_argument(
        "--to", dest="end", type=arguments.finite, metavar="S", help="of a recording: last second shown [s]"
    )
    parser.add_argument(
        "--output", metavar="F.html", help="of a recording: write the page to a file instead of serving it"
    )
    parser.add_argument("--port", type=_port, metavar="N", help="port on 127.0.0.1 (default: 8470, or a free one)")
    parser.add_argument("--no-browser", action="store_true", help="only print the address, open nothing")


def run(args: argparse.Namespace) -> int:
    """Show until Ctrl-C; returns 0."""
    opened = not args.no_browser and any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if args.bag is None:
        return _live(args, opened)
    output = checked(args.output, "--output", PAGE)
    page = _page(args)
    if output:
        write_text(output, page)
        print(f"page: {output} ({output.stat().st_size / 1e6:.1f} MB, opens without a network)")
        return 0
    from boom_view.server import ViewServer

    server = ViewServer(page, port=args.port)
    print(f"page: {server.url}  (Ctrl-C ends it)", flush=True)
    if opened:
        webbrowser.open(server.url)
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        return 0
    finally:
        server.server_close()
    return 0


def _page(args: argparse.Namespace) -> str:
    from boom_bringup.given import load_given
    from boom_recording.channels import JOINT_STATES, MACHINE_CONFIGURATION

    with progress(2) as step:
        step(f"reading {args.bag}", 1)
        recording = load_given(args.bag, args, require=(JOINT_STATES, MACHINE_CONFIGURATION))
        start, end = args.start or 0.0, math.inf if args.end is None else args.end
        if recording.duration <= 0.0:
            raise UsageError(
                f"{args.bag}: a single moment is recorded, nothing to show: record again, or give another bag"
            )
        if not 0.0 <= start < min(end, recording.duration):
            raise UsageError(
                f"--from {start:g} --to {end:g}: the recording is {recording.duration:.1f} s long: give a stretch inside it"
            )
        machine, _ = machine_of({args.bag: recording}, args.machine)
        step(f"running the model over {recording.name}", 1)
        from boom_model.errors import MachineError
        from boom_report.view.page import recording_page
        from boom_view.recorded import scene_of, series

        try:
            drawing, shown = scene_of(recording, machine), series(recording, machine, start, end)
        except MachineError as error:
            raise UsageError(misfit(args.bag, machine, recording.configuration, error)) from None
    length = f"{min(end, recording.duration) - start:.1f} s"
    stretch = f"{length} from {start:g} s on" if start else length
    model = (
        "the model is a free run on the recorded currents"
        if shown.models
        else "no currents were recorded: no model beside it"
    )
    damage = [f"damaged file: {warning}" for warning in recording.warnings]
    for line in damage:
        print(line, flush=True)
    return recording_page(drawing, shown, "; ".join([stretch, model, *damage]))


def _live(args: argparse.Namespace, opened: bool) -> int:
    for name, value in (("--output", args.output), ("--from", args.start), ("--to", args.end)):
        if value is not None:
            raise UsageError(f"{name} is for a recording: give its BAG, too")
    own = args.q3 is not None and args.q4 is not None
    if not own and (args.q3, args.q4, args.load) != (None, None, None):
        raise UsageError(
            "--q3, --q4 and --load stand for a missing /boom/machine_configuration: give both --q3 and --q4"
        )
    if own and not args.machine:
        raise UsageError("--q3 and --q4 say no machine: give its file, or tz17, with --machine")
    load = None if args.load is None or math.isnan(args.load) else args.load
    become_node(
        "boom_view.view_node",
        {
            "machine": args.machine, "joint_name": args.joint, "port": args.port, "open_browser": opened or None,
            "own_configuration": own or None, "outer_boom_angle": args.q3, "telescope_length": args.q4, "load_mass": load,
        },
    )  # fmt: skip


def _port(text: str) -> int:
    """A port number, 0 for any that is free."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value <= 65535:
        raise argparse.ArgumentTypeError(f"{text} is not a port: give 1 to 65535, or 0 for any that is free")
    return value
