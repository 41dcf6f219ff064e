"""The environment of our ROS processes in one place: ROS installation, network, checks.

Standard library only, and no import of this package: `./boom` loads this file by its path before anything is installed;
the tests apply it through `conftest.py`.

Network modes, chosen by the variable `BOOM_NETWORK`:

- `loopback` (default): the Fast DDS profile `loopback.xml`; every socket is bound to 127.0.0.1.
- `lan`: other hosts of the subnet take part; ROS's own variables decide the rest.

If the user names a Fast DDS profile file, that file decides, and the mode is called `custom`.
"""

from __future__ import annotations

import contextlib
import importlib.util
import ipaddress
import os
import socket
from collections.abc import Iterable, Iterator, Mapping, MutableMapping
from pathlib import Path
from typing import NamedTuple

NETWORK_MODES = ("loopback", "lan")
LOOPBACK_PROFILE = Path(__file__).resolve().with_name("loopback.xml")
# Above 101 the ports of a domain (7400 + 250 each) would lie where the kernel gives ports away; people begin at 0.
PRIVATE_DOMAINS = range(60, 101)
LARGEST_DOMAIN = 232
"""Beyond, the ports of a domain would lie above 65 535."""

# What a sourced ROS leaves behind and the wheels must not see, and the loader path that the wheels set for themselves.
FOREIGN_VARIABLES = (
    "AMENT_CURRENT_PREFIX",
    "AMENT_PREFIX_PATH",
    "CMAKE_PREFIX_PATH",
    "COLCON_CURRENT_PREFIX",
    "COLCON_PREFIX_PATH",
    "GZ_CONFIG_PATH",
    "LD_LIBRARY_PATH",
    "LD_PRELOAD",
    "PKG_CONFIG_PATH",
    "PYTHONHOME",
    "PYTHONPATH",
    "RMW_IMPLEMENTATION",
    "ROS_DISTRO",
    "ROS_PACKAGE_PATH",
    "ROS_PYTHON_VERSION",
    "ROS_VERSION",
    "VIRTUAL_ENV",
    "_ROS_WHEELS_BOOTSTRAP_COMPLETE",
)
# Each of these would take a process off the loopback, or make rmw_fastrtps open transports of its own.
_OPENING_VARIABLES = ("FASTDDS_BUILTIN_TRANSPORTS", "ROS_DISCOVERY_SERVER", "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS")
_PROFILE_VARIABLES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")


class EnvironmentSettingError(ValueError):
    """A variable of the user's environment has an impossible value; the message says which and what it may be."""

    exit_status = 2


class BoundSocket(NamedTuple):
    """One internet socket of a process and the local address it is bound to."""

    protocol: str
    address: str
    port: int


def sourced_ros(environment: Mapping[str, str]) -> str:
    """Name the ROS installation that was sourced in the user's shell.

    Args:
        environment: the user's variables, usually `os.environ`.

    Returns:
        A short name such as `jazzy (/opt/ros/jazzy)`, or "" where none was sourced.
    """
    prefixes = [p for p in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    distro = environment.get("ROS_DISTRO", "")
    if not prefixes and not distro:
        return ""
    return f"{distro or 'an installation'} ({prefixes[-1]})" if prefixes else distro


def network_mode(environment: Mapping[str, str]) -> str:
    """Tell how far messages may travel: `loopback`, `lan` or `custom`.

    Raises:
        EnvironmentSettingError: `BOOM_NETWORK` has an unknown value.
    """
    mode = environment.get("BOOM_NETWORK", "") or "loopback"
    if mode not in NETWORK_MODES:
        raise EnvironmentSettingError(
            f"BOOM_NETWORK={mode} is unknown: set it to {' or '.join(NETWORK_MODES)}, or unset it"
        )
    given = [environment[name] for name in _PROFILE_VARIABLES if environment.get(name)]
    if any(Path(path).name != LOOPBACK_PROFILE.name for path in given):
        return "custom"
    return mode


def ignored_range(environment: Mapping[str, str]) -> str:
    """Say in one sentence that a wider discovery range of the user has no effect; "" if that does not apply."""
    wanted = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if wanted == "SUBNET" and network_mode(environment) == "loopback":
        return (
            "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET is ignored, messages stay on this computer: "
            "set BOOM_NETWORK=lan to open the network"
        )
    return ""


def _set_network(environment: MutableMapping[str, str]) -> None:
    mode = network_mode(environment)
    if not environment.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp").startswith("rmw_fastrtps"):
        # The profile is Fast DDS's; for another middleware ROS's own restriction is what there is.
        environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET" if mode == "lan" else "LOCALHOST")
    elif mode == "loopback":
        for name in (*_OPENING_VARIABLES, *_PROFILE_VARIABLES):
            environment.pop(name, None)
        environment["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(LOOPBACK_PROFILE)
        # Not LOCALHOST: see loopback.xml. OFF is stricter still, and stays.
        if environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE") != "OFF":
            environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"
    elif mode == "lan":
        for name in _PROFILE_VARIABLES:
            environment.pop(name, None)
        if environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "") in ("", "SYSTEM_DEFAULT"):
            environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SUBNET"
    else:
        environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def for_processes(environment: Mapping[str, str]) -> dict[str, str]:
    """Make the environment in which our own ROS (the wheels in `.venv`) runs.

    Args:
        environment: the user's variables, usually `os.environ`. Not changed.

    Returns:
        A new environment: variables of a sourced ROS dropped, network restricted, message fields checked.

    Raises:
        EnvironmentSettingError: `BOOM_NETWORK` or `ROS_DOMAIN_ID` has an impossible value.
    """
    domain = environment.get("ROS_DOMAIN_ID", "")
    if domain and not (domain.isascii() and domain.isdigit() and int(domain) <= LARGEST_DOMAIN):
        raise EnvironmentSettingError(
            f"ROS_DOMAIN_ID={domain} is no domain: set it to 0 .. {LARGEST_DOMAIN}, or unset it"
        )
    result = {name: value for name, value in environment.items() if name not in FOREIGN_VARIABLES}
    result["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
    # Without it two values in a float64[3] would be sent with stray memory behind them.
    result.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
    # The parallel work here is many small pieces: threads inside each would wait for one another, and the rounding would depend on
    # how many there are.
    result.setdefault("OPENBLAS_NUM_THREADS", "1")
    result.setdefault("PYTHONUNBUFFERED", "1")
    result.setdefault("RCUTILS_COLORIZED_OUTPUT", "0")
    _set_network(result)
    return result


@contextlib.contextmanager
def private_domain() -> Iterator[str]:
    """Hold a ROS domain that no other isolated run on this computer uses and on which nothing else is heard.

    Two runs on one domain would hear each other: a demo could drive somebody else's crane. The domain is held by an
    abstract Unix socket: visible wherever loopback traffic goes (the network namespace), gone with the process.

    Yields:
        The value for `ROS_DOMAIN_ID`.

    Raises:
        EnvironmentSettingError: all of `PRIVATE_DOMAINS` are taken.
    """
    for number in PRIVATE_DOMAINS:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as lock:
            try:
                lock.bind(f"\0boom-domain-{number}")
            except OSError:
                continue
            if _is_silent(number):
                yield str(number)
                return
    raise EnvironmentSettingError(
        f"ROS domains {PRIVATE_DOMAINS[0]} to {PRIVATE_DOMAINS[-1]} are all in use: wait until other demos or tests have ended"
    )


def _is_silent(domain: int) -> bool:
    """Whether the port of a domain's first participant is free (RTPS 9.6.1.1: 7410 + 250 domain)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", 7410 + 250 * domain))
        except OSError:
            return False
    return True


def uses_wheels() -> bool:
    """Tell whether this Python has ROS from the wheels, and not from an installation."""
    return importlib.util.find_spec("ros_wheels_bootstrapper") is not None


def apply(environment: MutableMapping[str, str] | None = None) -> None:
    """Adapt the environment of the running process before it imports rclpy.

    Variables that the loader of the wheels has set stay, so that child processes inherit them. With an installed
    ROS only the network is restricted and the message check switched on: its other variables are needed.

    Args:
        environment: variables to change; `os.environ` by default.

    Raises:
        EnvironmentSettingError: `BOOM_NETWORK` has an unknown value.
    """
    target = os.environ if environment is None else environment
    if not uses_wheels():
        target.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
        _set_network(target)
        return
    kept = ("LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE") if "_ROS_WHEELS_BOOTSTRAP_COMPLETE" in target else ()
    wanted = for_processes(target)
    wanted.update({name: target[name] for name in kept if name in target})
    for name in [name for name in target if name not in wanted]:
        del target[name]
    target.update(wanted)


def _address(text: str) -> tuple[str, int]:
    words, port = text.split(":")
    # /proc prints an address as 32-bit words, each in the byte order of the machine (little endian here).
    raw = b"".join(bytes.fromhex(words[i : i + 8])[::-1] for i in range(0, len(words), 8))
    return str(ipaddress.ip_address(raw)), int(port, 16)


def bound_sockets(pid: int) -> list[BoundSocket]:
    """List the internet sockets of a process.

    Args:
        pid: process id; its `/proc` entries must be readable (own processes are).

    Returns:
        One entry per socket that has a local address, sorted. A process that has ended has none.
    """
    inodes = set()
    try:
        for entry in os.scandir(f"/proc/{pid}/fd"):
            try:
                target = os.readlink(entry.path)
            except OSError:
                continue
            if target.startswith("socket:["):
                inodes.add(target[len("socket:[") : -1])
    except OSError:
        return []
    found = []
    for protocol in ("udp", "udp6", "udplite", "udplite6", "tcp", "tcp6", "raw", "raw6"):
        try:
            lines = Path(f"/proc/{pid}/net/{protocol}").read_text(encoding="ascii").splitlines()[1:]
        except OSError:
            continue
        for line in lines:
            fields = line.split()
            if fields[9] in inodes:
                found.append(BoundSocket(protocol, *_address(fields[1])))
    return sorted(found)


def off_loopback(sockets: Iterable[BoundSocket]) -> list[BoundSocket]:
    """Pick the sockets that can be reached from, or can send to, other computers."""
    result = []
    for entry in sockets:
        address = ipaddress.ip_address(entry.address)
        if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
            address = address.ipv4_mapped
        if not address.is_loopback:
            result.append(entry)
    return result
