"""Parameters of the bridge in one table, read by the node; a test compares it with the README."""

from boom_node import face
from boom_node.parameters import ParameterSpec
from boom_node.publishers import PARAMETER as SHARED_TOPICS

PARAMETERS = (
    ParameterSpec("interface", "socketcan", "CAN interface, as python-can names it", read_only=True),
    ParameterSpec("channel", "can0", "channel of the interface, e.g. can0 or ws://127.0.0.1:54701/", read_only=True),
    ParameterSpec("bitrate", 0, "bit rate; 0: as the interface is set", "bit/s", 0, 1_000_000, read_only=True),
    ParameterSpec("dbc", "tz17", "DBC file: the name of one that is shipped, or a path", read_only=True),
    ParameterSpec("mapping", "", "mapping file; empty: the .yaml beside the DBC file", read_only=True),
    ParameterSpec("autostart", True, "configure and activate at the start, without a lifecycle manager", read_only=True),
    ParameterSpec("wait_for_bus", False, "start without the bus and wait for it, instead of ending with an error", read_only=True),
    ParameterSpec(
        "filter_foreign", True,
        "let the bus keep back frames that the mapping does not name (not with a log); false: their ids are in /diagnostics",
        read_only=True,
    ),
    ParameterSpec("log", "", "write all frames to this file (.blf, .asc, .log, .csv, .trc); empty: none", read_only=True),
    ParameterSpec("good_frames", 5, "good frames of each sensor before anything is published", "", 1, 1000, read_only=True),
    ParameterSpec("watchdog", 0.05, "silence of a sensor from which it counts as missing", "s", 0.01, 1.0, read_only=True),
    ParameterSpec("largest_current", 0.7, "largest current that is sent", "A", 0.0, 3.0, read_only=True),
    ParameterSpec("rise_rate", 20.0, "largest rise of a current; falling is not limited", "A/s", 0.1, 1000.0, read_only=True),
    ParameterSpec("command_timeout", 0.05, "age from which a command is not used any more", "s", 0.01, 0.1, read_only=True),
    ParameterSpec(
        "revoke_after", 1.0, "silence of the commands after which motion must be enabled anew", "s", 0.1, 3600.0, read_only=True
    ),
    ParameterSpec(
        "lockstep", False, "a simulated ECU in lockstep makes the time: publish it on /clock, send with each command only",
        read_only=True,
    ),
    ParameterSpec("machine", "tz17", "machine file that the configuration names", read_only=True),
    ParameterSpec("outer_boom_angle", 0.28, "locked outer boom joint q3", "rad", -3.2, 6.3, read_only=True),
    ParameterSpec("telescope_length", 2.2, "locked telescope extension q4, both stages", "m", 0.0, 20.0, read_only=True),
    ParameterSpec("load_mass", 0.0, "load at the tip; negative: not known", "kg", -1.0, 1e5, read_only=True),
    ParameterSpec("note", "", "text for the machine configuration", read_only=True),
    SHARED_TOPICS,
    *face.PARAMETERS,
    ParameterSpec("pressure_variance", 0.0, "variance of a pressure sensor, 0: unknown", "Pa^2", 0.0, 1e12, read_only=True),
)  # fmt: skip
