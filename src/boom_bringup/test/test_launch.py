"""The launch and parameter files name programs, parameters and values that exist.

`launch` is not on PyPI, so that the files run here against stand-ins that only note what they are given.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import sys
import types
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
import yaml

from boom_node.parameters import ParameterSpec

PACKAGE = Path(str(resources.files("boom_bringup")))
SOURCES = PACKAGE.parents[1]
LAUNCH_FILES = sorted((PACKAGE / "launch").glob("*.launch.py"))
CONFIG_FILES = sorted(SOURCES.glob("*/*/config/*.yaml"))
TABLES = {
    ("boom_sim", "simulation"): "boom_sim.settings",
    ("boom_sim", "ecu"): "boom_sim.ecu_node",
    ("boom_controller", "controller"): "boom_controller.node.node_parameters",
    ("boom_can_bridge", "bridge"): "boom_can_bridge.settings",
    ("boom_can_bridge", "enable"): "boom_can_bridge.enable_node",
    ("boom_recording", "recorder"): "boom_recording.recorder_node",
    ("boom_recording", "replay"): "boom_recording.replay_node",
    ("boom_description", "tip_pose"): "boom_description.tip_pose_node",
}
LAUNCH_MODULES = [
    "ament_index_python",
    "ament_index_python.packages",
    "launch",
    "launch.actions",
    "launch.conditions",
    "launch.event_handlers",
    "launch.events",
    "launch.substitutions",
    "launch_ros",
    "launch_ros.actions",
    "launch_ros.parameter_descriptions",
]
HEALTHY = SOURCES.parent / "bags" / "healthy" / "extended"


class Noted:
    """Stands for every class of launch and keeps what it was made with."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self.arguments, self.named = arguments, named

    def perform(self, context: dict[str, str]) -> str:
        return context[self.arguments[0]]


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, type[Noted]]]:
    kinds: dict[str, type[Noted]] = {}

    def kind(name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return kinds.setdefault(name, type(name, (Noted,), {}))

    for name in LAUNCH_MODULES:
        module = types.ModuleType(name)
        module.__getattr__ = kind  # type: ignore[method-assign]
        module.__path__ = []
        monkeypatch.setitem(sys.modules, name, module)
    share = sys.modules["ament_index_python.packages"]
    monkeypatch.setattr(
        share, "get_package_share_directory", lambda package: str(resources.files(package)), raising=False
    )
    yield kinds


def table(package: str, executable: str) -> dict[str, ParameterSpec]:
    module = importlib.import_module(TABLES[package, executable])
    return {spec.name: spec for spec in getattr(module, "NODE_PARAMETERS", module.PARAMETERS)}


def load_file(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.name.replace(".", "_"), path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def nodes_of(path: Path, kinds: dict[str, type[Noted]], context: dict[str, str]) -> tuple[list[Noted], list[Noted]]:
    """The declared arguments and the nodes that a launch file makes."""
    actions = list(load_file(path).generate_launch_description().arguments[0])
    defaults = {
        a.arguments[0]: a.named.get("default_value") for a in actions if type(a) is kinds["DeclareLaunchArgument"]
    }
    for action in list(actions):
        if type(action) is kinds.get("OpaqueFunction"):
            actions += action.named["function"](defaults | context)
    return (
        [action for action in actions if type(action) is kinds["DeclareLaunchArgument"]],
        [action for action in actions if type(action) is kinds["Node"]],
    )


def context(tmp_path: Path) -> dict[str, str]:
    return {"bag": str(HEALTHY), "output": str(tmp_path / "new"), "seed": "7", "transport": "can"}


def programs(package: str) -> set[str]:
    """Names of the console scripts in a package's setup.py."""
    for call in ast.walk(ast.parse((SOURCES / package / "setup.py").read_text(encoding="utf-8"))):
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "setup":
            entry_points = next(word.value for word in call.keywords if word.arg == "entry_points")
            return {line.split("=")[0].strip() for line in ast.literal_eval(entry_points)["console_scripts"]}
    raise AssertionError(f"no setup() in {package}")


def test_there_is_a_launch_file_for_the_simulation_and_for_the_demo() -> None:
    assert [path.name for path in LAUNCH_FILES] == ["demo.launch.py", "sim.launch.py"]


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_nodes_exist_and_their_parameters_are_known(path: Path, launch: dict[str, type[Noted]], tmp_path: Path) -> None:
    _, nodes = nodes_of(path, launch, context(tmp_path))
    assert nodes
    for node in nodes:
        package, executable = node.named["package"], node.named["executable"]
        if package == "robot_state_publisher":  # of ROS
            continue
        assert executable in programs(package)
        known = table(package, executable)
        for source in node.named["parameters"]:
            if isinstance(source, dict):
                assert set(source) <= set(known)
                for name, value in source.items():
                    assert known[name].problem(value.arguments[0] if isinstance(value, Noted) else value) is None
            elif isinstance(source, str):
                assert Path(source).is_file()


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_every_argument_has_a_description(path: Path, launch: dict[str, type[Noted]], tmp_path: Path) -> None:
    arguments, _ = nodes_of(path, launch, context(tmp_path))
    assert arguments
    assert all(argument.named["description"] for argument in arguments)


SIM = PACKAGE / "launch" / "sim.launch.py"


@pytest.mark.parametrize(("transport", "crane"), [("topics", {"simulation"}), ("can", {"bridge", "ecu", "enable"})])
def test_one_launch_starts_crane_frames_and_controller(
    launch: dict[str, type[Noted]], transport: str, crane: set[str]
) -> None:
    _, nodes = nodes_of(SIM, launch, {"control": "true", "transport": transport})
    told = {node.named["executable"]: node.named["parameters"][-1] for node in nodes}
    assert set(told) == crane | {"robot_state_publisher", "controller"}
    assert told["robot_state_publisher"]["robot_description"].arguments[0].startswith("<?xml")
    assert told["bridge" if transport == "can" else "simulation"]["publish_description"] is False


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"load_mass": "heavy"}, "load_mass:=heavy: give a number"),
        ({"machine": "nowhere.yaml"}, "nowhere.yaml"),
        ({"transport": "can", "mode": "lockstep"}, "real time"),
    ],
)
def test_a_launch_argument_that_cannot_be_is_one_line(
    launch: dict[str, type[Noted]], given: dict[str, str], words: str
) -> None:
    with pytest.raises(RuntimeError, match=words):
        nodes_of(SIM, launch, given)


def test_defaults_of_the_simulation_arguments_are_possible_values(launch: dict[str, type[Noted]]) -> None:
    known = table("boom_sim", "simulation")
    for name, (kind, default, _) in load_file(PACKAGE / "launch" / "sim.launch.py").ARGUMENTS.items():
        value = {"true": True, "false": False}[default] if kind is bool else kind(default)
        assert known[name].problem(value) is None


@pytest.mark.parametrize(("transport", "crane"), [("can", "ecu"), ("topics", "simulation")])
def test_demo_starts_the_simulation_in_the_pose_of_the_recording(
    launch: dict[str, type[Noted]], tmp_path: Path, transport: str, crane: str
) -> None:
    wanted = context(tmp_path) | {"transport": transport}
    _, nodes = nodes_of(PACKAGE / "launch" / "demo.launch.py", launch, wanted)
    simulation = next(node for node in nodes if node.named["executable"] == crane).named["parameters"][-1]
    assert (simulation["outer_boom_angle"], simulation["telescope_length"]) == (0.28, 2.2)
    assert simulation["machine"] == "tz17"
    assert simulation["seed"] == 7


def test_demo_over_can_has_everybody_on_one_bus(launch: dict[str, type[Noted]], tmp_path: Path) -> None:
    _, nodes = nodes_of(PACKAGE / "launch" / "demo.launch.py", launch, context(tmp_path))
    told = {node.named["executable"]: node.named["parameters"][-1] for node in nodes}
    assert set(told) == {"recorder", "bridge", "ecu", "enable", "replay"}
    assert told["bridge"]["channel"] == told["ecu"]["channel"]
    assert told["ecu"]["mode"] == "lockstep"
    assert told["bridge"]["lockstep"] is told["replay"]["on_ticks"] is True


def test_demo_tells_a_transport_that_does_not_exist(launch: dict[str, type[Noted]], tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="give can or topics"):
        nodes_of(PACKAGE / "launch" / "demo.launch.py", launch, context(tmp_path) | {"transport": "flexray"})


def test_demo_tells_a_bag_that_is_not_there(launch: dict[str, type[Noted]], tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="nowhere"):
        nodes_of(PACKAGE / "launch" / "demo.launch.py", launch, context(tmp_path) | {"bag": str(tmp_path / "nowhere")})


@pytest.mark.parametrize("path", CONFIG_FILES, ids=lambda path: path.name)
def test_parameter_file_holds_for_every_name_of_its_node_and_only_known_values(path: Path) -> None:
    document = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert list(document) == ["/**"], "a section with the bare name of a node would be ignored"
    known = table(*next(key for key in TABLES if key[1] == path.stem))
    for name, value in document["/**"]["ros__parameters"].items():
        assert known[name].problem(value) is None
