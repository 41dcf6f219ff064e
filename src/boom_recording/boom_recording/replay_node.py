"""Replays a recording: ``python -m boom_recording.replay_node --ros-args -p bag:=FOLDER``.

The recorded solenoid currents become commands, or the recorded angle becomes the reference; at any rate, or in lockstep
with the simulation (`boom_recording.replay` describes the protocol). However the replay ends, commands end with zero currents.
Parameters and conditions: README.md.
"""

# ruff: noqa: I001
from boom_node import early  # noqa: F401  (first: signals and environment)

import math
import threading
import time
from typing import Any

from boom_interfaces.msg import SolenoidCurrents
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from boom_node import qos, shell, stamps
from boom_node.diagnostics import DiagnosticsPublisher, Health, Level
from boom_node.errors import StartError
from boom_node.node import Node
from boom_node.parameters import ParameterSpec, declare
from boom_node.commands import LONGEST_SILENCE_S
from boom_node.publishers import SolePublishers
from boom_recording import replay
from boom_recording.channels import CURRENT_COMMAND, DEFAULT_JOINT, JOINT_STATES, REFERENCE, SOLENOID_CURRENTS
from boom_recording.errors import RecordingError
from boom_recording.loading import load
from boom_recording.pacing import ReplayPacer, StoodStillError

PARAMETERS = (
    ParameterSpec("bag", "", "rosbag2 directory or .mcap file", read_only=True),
    ParameterSpec(
        "what",
        replay.COMMANDS,
        "recorded currents as commands, or recorded angle as reference",
        choices=replay.CONTENTS,
        read_only=True,
    ),
    ParameterSpec(
        "rate",
        1.0,
        "how many times faster than recorded, at least so fast that samples go out 90 ms apart; without effect in lockstep",
        "",
        1e-3,
        1e3,
        read_only=True,
    ),
    ParameterSpec("start", 0.0, "start within the recording", "s", 0.0, 1e6, read_only=True),
    ParameterSpec("duration", 0.0, "duration to replay, 0 = to the end", "s", 0.0, 1e6, read_only=True),
    ParameterSpec("loop", False, "restart at the end; a reference is led back slowly", read_only=True),
    ParameterSpec(
        "paused", False, "wait for the service ~/pause (data: false) before the first message", read_only=True
    ),
    ParameterSpec(
        "clock",
        False,
        "publish /clock with the replayed time; not in lockstep, where the simulation owns it",
        read_only=True,
    ),
    ParameterSpec("start_time", 0.0, "time on /clock of the first message", "s", 0.0, 2e9, read_only=True),
    ParameterSpec(
        "lockstep", False, "one message per /clock tick of the simulation, as fast as both allow", read_only=True
    ),
    ParameterSpec(
        "wait_for",
        1,
        "subscribers of the output topic to wait for before the first message",
        "",
        0,
        100,
        read_only=True,
    ),
    ParameterSpec("wait_for_recorder", False, "also wait for /boom_recorder/ready", read_only=True),
    ParameterSpec("wait_for_motion", False, "wait until the CAN bridge reports that motion is enabled", read_only=True),
    ParameterSpec(
        "on_ticks", False, "lockstep: commands act from their tick on, not from their stamp (over CAN)", read_only=True
    ),
    ParameterSpec("wait_timeout", 20.0, "how long to wait for them", "s", 0.1, 3600.0, read_only=True),
    ParameterSpec(
        "tick_timeout", 5.0, "lockstep: longest time without a tick of /clock", "s", 0.1, 3600.0, read_only=True
    ),
    ParameterSpec("joint", DEFAULT_JOINT, "name of the boom's joint", read_only=True),
)
_CHECK_PERIOD_S = 0.05
_MOST_APART_S = 0.9 * LONGEST_SILENCE_S
_TOLD_EVERY = 500  # messages; some 5 s of a recording
_SETTLE_S = 0.2  # the two ends of a connection learn of each other one after the other
_ACKNOWLEDGE_S = 1.0
_SILENT_S = 1.5
"""After which it is told what is waited for."""


class ReplayNode(Node):
    """The replay as a ROS node: sends what `boom_recording.replay` selects."""

    def __init__(self) -> None:
        super().__init__("boom_replay")
        values = declare(self, PARAMETERS)
        self._values = values
        if not values.bag:
            raise StartError("boom_replay needs the parameter 'bag', e.g. -p bag:=my_recording")
        if values.lockstep and (values.clock or values.loop or values.paused):
            raise StartError("lockstep does not support clock, loop or paused: leave these parameters out")
        try:
            needed = SOLENOID_CURRENTS if values.what == replay.COMMANDS else JOINT_STATES
            recording = load(values.bag, require=(needed,), joint=values.joint)
            self._samples = replay.part(replay.samples(recording, values.what), values.start, values.duration)
        except RecordingError as error:
            raise StartError(str(error)) from None
        if not values.lockstep and (apart := replay.apart(self._samples) / values.rate) > _MOST_APART_S:
            least = values.rate * apart / _MOST_APART_S
            raise StartError(
                f"at a rate of {values.rate:g} samples go out {1e3 * apart:.0f} ms apart, and a valve is closed after "
                f"{1e3 * LONGEST_SILENCE_S:.0f} ms without one: give a rate of at least {least:.2g}"
            )
        if values.loop and values.what == replay.REFERENCE:
            self._samples = replay.with_way_back(self._samples)
        for warning in recording.warnings:
            self.get_logger().warning(f"{values.bag}: {warning}")
        self._duration_s = (self._samples[-1].stamp_ns + replay.PERIOD_NS) / 1e9
        self._commands = values.what == replay.COMMANDS
        self._topic = CURRENT_COMMAND if self._commands else REFERENCE
        kind: Any = SolenoidCurrents if self._commands else JointState
        self._output = self.create_publisher(kind, self._topic, qos.BY_TOPIC[self._topic])
        self._clock_output = self.create_publisher(ClockMessage, "/clock", qos.CLOCK) if values.clock else None
        self._sole = SolePublishers(self, (CURRENT_COMMAND,) if self._commands else ())
        self._recorder_ready = False
        if values.wait_for_recorder:
            self.create_subscription(Bool, "/boom_recorder/ready", self._on_recorder, qos.LATCHED)
        self._motion_enabled = False
        if values.wait_for_motion:
            self.create_subscription(Bool, "/boom_can_bridge/motion_enabled", self._on_motion, qos.LATCHED)
        self.create_service(SetBool, "~/pause", self._on_pause)
        self._pacer = ReplayPacer(
            values.rate,
            self._send_paced,
            self._publish_clock if values.clock else None,
            stamps.seconds_to_ns(values.start_time),
            LONGEST_SILENCE_S if self._commands else math.inf,
        )
        if values.paused:
            self._pacer.pause()
        self._lockstep = (
            replay.ReplayLockstep(
                self._samples, stamps.seconds_to_ns(values.start_time), what=values.what, on_ticks=values.on_ticks
            )
            if values.lockstep
            else None
        )
        self._thread: threading.Thread | None = None
        self._created = time.monotonic()
        self._complete_since: float | None = None
        self._last_tick = 0.0
        self._unheard = False
        self._followers = set[bytes]()
        self._sent = 0
        self._state, self._told_missing = "waiting", list[str]()
        self._diagnostics = DiagnosticsPublisher(self, self._health)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._clock_subscription: Any = None
        self._watch = self.create_timer(_CHECK_PERIOD_S, self._check, clock=self._steady)

    def close(self) -> None:
        """Stop sending; commands end with zero currents."""
        self._pacer.stop()
        if self._thread is not None:
            self._thread.join()
        self._end_with_zero()

    def stop_safely(self, _reason: str) -> None:
        """Stop sending after a callback has raised; commands end with zero currents."""
        self._pacer.stop()
        self._state = "failed"
        self._end_with_zero()

    # ---- before the first message ----

    def _check(self) -> None:
        if self._state == "waiting":
            self._wait()
        elif self._state == "replaying":
            self._count_listeners()
        elif self._state == "lockstep" and time.monotonic() - self._last_tick > self._values.tick_timeout:
            self._state = "failed"
            alive = self.count_publishers("/clock") > 0
            reason = "the simulation stands still" if alive else "/clock has no publisher any more"
            shell.finish(
                2,
                f"no tick on /clock for {self._values.tick_timeout:g} s: {reason}; start the simulation in lockstep",
            )

    def _count_listeners(self) -> None:
        following = self._following()
        self._followers = self._followers or following
        if self._followers and self._followers.isdisjoint(following):
            self._state = "failed"
            self._pacer.stop()
            shell.finish(
                2,
                f"what followed {self._topic} has gone after {self._sent} messages: what comes in its place is not moved by "
                "the rest. Start it, and then the replay again",
            )
            return
        listeners, wanted = self._output.get_subscription_count(), self._values.wait_for
        if listeners < wanted and not self._unheard:
            self.get_logger().warning(
                f"{listeners} of {wanted} subscribers of {self._topic} left: has one of them died?"
            )
        self._unheard = listeners < wanted

    def _following(self) -> set[bytes]:
        """Ends of the topic at nodes that answer: a crane has joint states, a controller commands."""
        answer = JOINT_STATES if self._commands else CURRENT_COMMAND
        nodes = {(info.node_name, info.node_namespace) for info in self.get_publishers_info_by_topic(answer)}
        ends = self.get_subscriptions_info_by_topic(self._topic)
        return {bytes(info.endpoint_gid) for info in ends if (info.node_name, info.node_namespace) in nodes}

    def _wait(self) -> None:
        missing = self._missing()
        now = time.monotonic()
        if missing:
            self._complete_since = None
            if now - self._created > _SILENT_S and missing != self._told_missing:
                self._told_missing = missing
                self.get_logger().warning(f"waiting up to {self._values.wait_timeout:g} s for {', '.join(missing)}")
            if now - self._created > self._values.wait_timeout:
                self._state = "failed"
                shell.finish(
                    2,
                    f"nothing was replayed, still missing after {self._values.wait_timeout:g} s: {', '.join(missing)}",
                )
            return
        if self._complete_since is None:
            self._complete_since = now
        if now - self._complete_since >= (_SETTLE_S if self._values.wait_for or self._lockstep else 0.0):
            self._begin()

    def _missing(self) -> list[str]:
        missing = []
        if self._output.get_subscription_count() < self._values.wait_for:
            missing.append(f"a subscriber of {self._topic} (is the simulation or the controller running?)")
        if self._sole.look():
            missing.append(f"the topic without another publisher, {self._sole.conflict}")
        if self._values.wait_for_recorder and not self._recorder_ready:
            missing.append(
                "/boom_recorder/ready (is the recorder running, and do its required topics have publishers?)"
            )
        if self._values.wait_for_motion and not self._motion_enabled:
            missing.append("/boom_can_bridge/motion_enabled (is the bridge running, and was its ~/enable called?)")
        if self._lockstep is not None and not self._subscribe_clock():
            missing.append("a publisher of /clock (is the simulation running in lockstep?)")
        return missing

    def _subscribe_clock(self) -> bool:
        """Subscribe to /clock as reliably as it is offered (a lost tick would stop both); False without a publisher."""
        if self._clock_subscription is None:
            offered = [info.qos_profile for info in self.get_publishers_info_by_topic("/clock")]
            if not offered:
                return False
            reliable = all(profile.reliability == QoSReliabilityPolicy.RELIABLE for profile in offered)
            reliability = QoSReliabilityPolicy.RELIABLE if reliable else QoSReliabilityPolicy.BEST_EFFORT
            self._clock_subscription = self.create_subscription(
                ClockMessage, "/clock", self._on_clock, QoSProfile(depth=100, reliability=reliability)
            )
        return bool(self._clock_subscription.get_publisher_count() > 0)

    def _begin(self) -> None:
        if self._lockstep is not None:
            self._state = "lockstep"
            self._last_tick = time.monotonic()
            self._send(self._lockstep.first())
            return
        self._state, self._followers = "replaying", self._following()
        self._thread = threading.Thread(target=self.guarded("replay", self._play), daemon=True)
        self._thread.start()

    # ---- sending ----

    def _play(self) -> None:
        try:
            if self._pacer.run(replay.endless(self._samples, self._values.loop)):
                self._finish()
        except StoodStillError as error:
            self.stop_safely("")
            shell.finish(2, str(error))

    def _on_clock(self, message: ClockMessage) -> None:
        if self._state != "lockstep" or self._lockstep is None:
            return
        tick_ns = stamps.to_ns(message.clock)
        wrong = stamps.far(tick_ns, self._lockstep.next_tick_ns)
        if wrong:
            self.guard.refuse("/clock", "far from the tick before", wrong)
            return
        self._last_tick = time.monotonic()
        if self._lockstep.finished:
            self._finish()
            return
        answer = self._lockstep.answer(tick_ns)
        if answer is not None:
            self._send(answer)

    def _finish(self) -> None:
        self._state = "finished"
        self.get_logger().info(f"replayed {self._sent} messages to {self._topic}")
        shell.finish(0)

    def _send_paced(self, sample: replay.ReplaySample, clock_ns: int) -> None:
        stamp = clock_ns if self._values.clock else self.get_clock().now().nanoseconds
        self._send(replay.ReplaySample(stamp, sample.values, sample.gap))

    def _send(self, sample: replay.ReplaySample) -> None:
        if sample.gap:
            self.get_logger().warning("gap in the recorded currents: commanding zero until they are known again")
        message = self._message(sample)
        self._output.publish(message)
        self._sent += 1
        if self._sent % _TOLD_EVERY == 0:
            total = len(self._samples)
            done = self._duration_s * (((self._sent - 1) % total) + 1) / total
            self.get_logger().info(f"replayed {done:.0f} of {self._duration_s:.0f} s")

    def _message(self, sample: replay.ReplaySample) -> Any:
        if self._commands:
            message: Any = SolenoidCurrents(retract=sample.values[0], extend=sample.values[1])
        else:
            message = JointState(name=[self._values.joint], position=[sample.values[0]])
        stamps.set_ns(message.header.stamp, sample.stamp_ns)
        return message

    def _publish_clock(self, clock_ns: int) -> None:
        assert self._clock_output is not None  # only called where /clock is asked for
        message = ClockMessage()
        stamps.set_ns(message.clock, clock_ns)
        self._clock_output.publish(message)

    def _end_with_zero(self) -> None:
        if not self._commands or not self._sent:
            return
        now = self.get_clock().now().nanoseconds
        if self._lockstep is not None:
            now = self._lockstep.next_tick_ns
        elif self._values.clock:
            now = self._pacer.clock_ns
        self._output.publish(self._message(replay.ReplaySample(now, (0.0, 0.0))))
        self._output.wait_for_all_acked(Duration(seconds=_ACKNOWLEDGE_S))

    # ---- requests and health ----

    def unfinished(self) -> str:
        """How far it came; nothing of one that repeats."""
        return "" if self._values.loop else f"replay stopped after {self._sent} of {len(self._samples)} messages"

    def _on_recorder(self, message: Bool) -> None:
        self._recorder_ready = message.data

    def _on_motion(self, message: Bool) -> None:
        self._motion_enabled = message.data

    def _on_pause(self, request: Any, response: Any) -> Any:
        if self._lockstep is not None:
            response.success, response.message = (
                False,
                "in lockstep the simulation is paused, not the replay: use its ~/pause",
            )
            return response
        if request.data:
            self._pacer.pause()
            self._end_with_zero()
        else:
            self._pacer.resume()
        response.success, response.message = True, "paused" if request.data else "going on"
        self._diagnostics.update()
        return response

    def _health(self) -> Health:
        values = {"messages sent": self._sent, "messages in all": len(self._samples)}
        if self._state == "waiting":
            return Health(Level.WARN, f"waiting for {', '.join(self._missing()) or 'connections to settle'}", values)
        if self._state == "failed":
            return Health(Level.ERROR, "stopped: start it again", values)
        return Health(Level.OK, "paused" if self._pacer.paused else self._state, values)


def main() -> int:
    """Replay until the end or a signal. Returns the exit status."""
    return shell.run(ReplayNode)


if __name__ == "__main__":
    raise SystemExit(main())
