"""The ECU stand-in as a process: the simulated crane on a CAN bus. ROS is used for parameters, services and diagnostics.

Parameters, services, faults and what closes the valve: docs/can_faults.md.
"""

# ruff: noqa: I001
from __future__ import annotations

from boom_node import early  # noqa: F401  (first: signals and environment)

import functools
from typing import Any

from boom_can_bridge.python_can import can
from boom_can_bridge.codec import CanConfigurationError, Codec
from boom_interfaces.msg import GroundTruth
from boom_interfaces.srv import SetPayload
from boom_model.errors import ModelError
from boom_node import face, parameters, qos, shell
from boom_node.diagnostics import DiagnosticsPublisher, Health, Level
from boom_node.errors import StartError
from boom_node.node import Node
from boom_node.parameters import ParameterSpec
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from std_srvs.srv import Trigger

from boom_sim import ecu_faults, messages, settings
from boom_sim.ecu import Ecu, Mode
from boom_sim.ecu_loop import EcuLoop
from boom_sim.simulated_crane import PERIOD

_LOOK_PERIOD = 0.05
_NOT_ON_A_BUS = ("shared_topics", *(spec.name for spec in face.PARAMETERS))

PARAMETERS = (
    *(spec for spec in settings.PARAMETERS if spec.name not in _NOT_ON_A_BUS),
    ParameterSpec("interface", "remote", "python-can interface, e.g. remote, socketcan, slcan", read_only=True),
    ParameterSpec("channel", "ws://127.0.0.1:54701/", "channel of the interface, e.g. can0", read_only=True),
    ParameterSpec(
        "bitrate", 250000, "bit rate of the bus, if the interface sets it", "bit/s", 10000, 1000000, read_only=True
    ),
    ParameterSpec("dbc", "tz17", "DBC file: the name of one that is shipped, or a path", read_only=True),
    ParameterSpec("mapping", "", "mapping file (.yaml); empty: the one that belongs to the DBC", read_only=True),
    *ecu_faults.PARAMETERS,
)


class EcuNode(Node):
    """Thin layer around :class:`boom_sim.ecu_loop.EcuLoop`."""

    def __init__(self) -> None:
        super().__init__("boom_ecu")
        values = parameters.declare(self, PARAMETERS)
        self._values = values
        if values.interface not in can.VALID_INTERFACES:
            raise StartError(
                f"python-can has no interface '{values.interface}'{parameters.nearest(values.interface, can.VALID_INTERFACES)}"
            )
        try:
            self._crane = settings.make_crane(values)
            codec = Codec.load(values.dbc, values.mapping or None)
            self._ecu = Ecu(self._crane, codec, lockstep=values.mode == "lockstep")
        except (ModelError, CanConfigurationError) as error:
            raise StartError(str(error)) from error
        open_bus = functools.partial(
            can.Bus, interface=values.interface, channel=values.channel, bitrate=values.bitrate
        )
        self._loop = EcuLoop(self._ecu, open_bus, seed=values.seed)
        self._diagnostics = DiagnosticsPublisher(self, self._health, self._crane.machine.name)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self.create_service(SetPayload, "~/set_payload", self._on_set_payload)
        self._said = ""
        self._state: object = None
        # The executor knows no guard conditions, and the ECU's thread has no time for ROS.
        self.create_timer(_LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        if values.ground_truth:
            self._truth = self.create_publisher(GroundTruth, "/boom/ground_truth", qos.SENSOR_DATA)
            self.create_timer(PERIOD, self._publish_truth, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._faults: dict[str, Any] = {}
        self._set_faults({spec.name: getattr(values, spec.name) for spec in ecu_faults.PARAMETERS})
        self.add_on_set_parameters_callback(self._on_parameters)
        self._loop.begin()
        self.get_logger().info(
            f"ECU of {self._crane.machine.name} on {values.interface} {values.channel}, DBC {values.dbc}, "
            f"{values.mode.replace('_', ' ')}"
        )

    def close(self) -> None:
        """Leave the bus."""
        self._loop.end()

    def stop_safely(self, _reason: str) -> None:
        """Close the valve until one command of zero, after a callback has raised."""
        with self._loop.lock:
            self._ecu.stop()

    def _look(self) -> None:
        if self._loop.error is not None:
            shell.finish(1, f"the ECU's cycle ended: {type(self._loop.error).__name__}: {self._loop.error}")
            return
        state = (self._loop.connection, self._ecu.mode, self._ecu.faults, self._ecu.failure)
        if state != self._state:
            self._state = state
            health = self._health()
            if health.message != self._said:
                self._said = health.message
                # Two calls: rclpy refuses one place in the code that logs at two levels.
                if health.level == Level.OK:
                    self.get_logger().info(health.message)
                else:
                    self.get_logger().warning(health.message)
            self._diagnostics.update()

    # ----------------------------------------------------------------------------------------------------- parameters

    def _on_parameters(self, changed: list[Any]) -> SetParametersResult:
        faults = {p.name: p.value for p in changed if p.name.startswith("fault_")}
        by_name = {spec.name: spec for spec in ecu_faults.PARAMETERS}
        for name, value in faults.items():
            problem = by_name[name].problem(value) if name in by_name else f"no parameter '{name}'"
            if problem:
                return SetParametersResult(successful=False, reason=problem)
        if faults:
            self._set_faults(faults)
        return SetParametersResult(successful=True)

    def _set_faults(self, changed: dict[str, Any]) -> None:
        self._faults |= changed
        self._loop.set_faults(
            ecu_faults.from_values(self._faults),
            self._faults["fault_direction"],
            frozen_counter=self._faults["fault_frozen_counter"],
        )
        if changed.get("fault_bus_off", 0.0) > 0.0:
            self._loop.bus_off(changed["fault_bus_off"])
        if changed.get("fault_restart", 0.0) > 0.0:
            self._loop.restart(changed["fault_restart"])

    # ------------------------------------------------------------------------------------------------ services, topics

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        # Made beside the running cycle: the frames do not stop for it.
        self._crane = settings.make_crane(self._values)
        self._loop.reset(self._crane)
        self._diagnostics.update()
        response.success, response.message = True, f"back at {self._crane.sample.angle:.3f} rad, time 0"
        return response

    def _on_set_payload(self, request: SetPayload.Request, response: SetPayload.Response) -> SetPayload.Response:
        with self._loop.lock:
            before = self._crane.load
            try:
                self._crane.set_load(request.mass)
            except ModelError as error:
                response.success, response.message = False, str(error)
                return response
            text = f"load {before:g} kg -> {self._crane.load:g} kg at {self._crane.time:.2f} s"
        response.success, response.message = True, text
        self.get_logger().info(text)
        return response

    def _publish_truth(self) -> None:
        with self._loop.lock:
            names, states, units = self._crane.truth
            currents = self._ecu.currents
        self._truth.publish(
            messages.ground_truth(
                (*names, "retract_current", "extend_current"),
                [*states.tolist(), *currents],
                (*units, "A", "A"),
                self.get_clock().now().nanoseconds,
            )
        )

    def _health(self) -> Health:
        loop, ecu = self._loop, self._ecu
        with loop.lock:
            mode, faults, failure = ecu.mode, ecu.faults, ecu.failure
            refused = dict(ecu.refused)
            to_bus, from_bus = loop.to_bus.counts, loop.from_bus.counts
        values: dict[str, object] = {
            "time [s]": f"{self._crane.time:.2f}",
            "load [kg]": f"{self._crane.load:g}",
            "connection": loop.connection,
            "mode": mode.name.lower(),
            "faults": "|".join(f.name.lower() for f in faults if f.name) or "none",
            "retract current [A]": f"{ecu.currents[0]:.3f}",
            "extend current [A]": f"{ecu.currents[1]:.3f}",
            "frames sent": loop.sent,
            "frames received": loop.received,
            "frames not sent": loop.unsent,
            "cycles skipped": loop.skipped,
            "commands followed": ecu.accepted,
            "injected: frames lost": to_bus.lost + from_bus.lost,
            "injected: bits flipped": to_bus.flipped + from_bus.flipped,
            "injected: frames reordered": to_bus.reordered + from_bus.reordered,
        }
        values |= {f"commands refused, {reason}": count for reason, count in refused.items()}
        if failure:
            return Health(Level.ERROR, f"the simulation stands: {failure}; call ~/reset to restart", values)
        if loop.connection != "connected":
            return Health(Level.WARN, loop.connection, values)
        if mode == Mode.FAULT:
            why = values["faults"]
            return Health(Level.WARN, f"valve closed ({why}) until a command of zero or without enable", values)
        return Health(Level.OK, {Mode.ACTIVE: "driving", Mode.READY: "valve closed"}.get(mode, "starting"), values)


def main() -> int:
    """Runs the node until SIGINT or SIGTERM; returns the exit status."""
    return shell.run(EcuNode)


if __name__ == "__main__":
    raise SystemExit(main())
